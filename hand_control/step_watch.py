"""Angles that step as no motion does: mirrored, negated, exchanged and displaced sensors, in motion.

Over six samples z, a, b | c, d, e at least SPACING_S apart, the speed v of a, b predicts c; DEV is the deviation
of c from it, and TRAVEL = e - c. A joint that really deviates by DEV within a sample has a speed of about DEV / dt, and
loses it no faster than J / d (Eq. 8), so that it moves on; or it has met an obstacle, and then it has lost its speed v
and comes back with at most RESTITUTION of it. A sensor that steps goes on as if nothing had happened:

    hypothesis                        angle c                                      TRAVEL
    mirrored about M, or about zero   M - prediction                               that of -v
    exchanged with joint k            the prediction of joint k, and c_k that of   that of v_k
                                      this joint
    exchanged where the angles cross  the prediction                               that of v_k
    displaced                         further than MAX_OUTSIDE_NM, an obstacle     below half of DEV
                                      that lets go and the neighbour can move it

Angles that cross make no step, and new set-points of two joints may exchange their speeds there, too. An exchange is
believed where no pressure, with a model that is WRONG, and no obstacle gives the new speed of at least one of them.
Where both may have got theirs so, the pair is UNDECIDED: its set-points rise slowly until both joints have moved as
their pressures ask, and the place watch compares them.

Where samples are further apart than MOMENTUM_S, up to LONGEST_S, a joint has lost its momentum between two of them:
then only a deviation counts that neither the pressure nor an obstacle gives, for an exchange of both joints.
Turns of a joint whose neighbour also turns (they share inertia), that was not in smooth motion before, or that a
constant acceleration explains are no evidence of a mirror.

References: Brogliato, Nonsmooth Mechanics, 2016 (restitution).
"""

from __future__ import annotations

import math

from hand_control import sensor_rows as row
from hand_control.declared import inlined
from hand_model.compile_cache import without_arrays
from hand_model.statics import torque

MAX_OUTSIDE_NM = 0.25
"""Largest torque of a hand or an object on a joint that is taken for real: an actuator gives up to about 0.5 N m."""
WRONG = 0.3
"""Share by which each constant of the model may be wrong."""
RESTITUTION = 0.5
"""Largest share of its speed with which a joint comes back from an obstacle: the fingers are soft."""
SPACING_S, MOMENTUM_S, LONGEST_S = 0.004, 0.012, 0.0305
"""Least time between two samples of the step test, the longest that lets a momentum be seen, and the longest of all:
beyond 30 ms and the jitter of the stamps, a push of MAX_OUTSIDE_NM moves a joint through its whole range."""
LEAST_RAD, STEP_RAD, NOISES, NOISE_S = math.radians(0.1), math.radians(0.5), 6.0, 1.0
"""A break is larger than LEAST_RAD and NOISES times the mean second difference over NOISE_S; a step than STEP_RAD."""
SLACK = 0.3
"""Share of a deviation and of a path by which hypotheses may miss: acceleration, jitter of the stamps."""
STAYS = 0.5
"""Share of a deviation by which a sensor that has stepped goes on otherwise, at most, where an acceleration counts."""
REVERSED = 0.65
"""Share of the speed with which a joint turns back only where its sensor is mirrored, above RESTITUTION; what the
neighbour met during or just before the turn may add to it."""
EXCHANGED = 0.2
"""Share of a difference by which an exchange may miss."""
STEADY = 0.2
"""Speeds that are exchanged were steady before: within this share of their difference, from sample to sample. Going on
so, the change gives half of the difference over the two samples after the break; at 0.4 it would give all of it."""
SMOOTH = 8.0
"""Least size of a turn, in changes of speed before it, that no constant acceleration explains; one gives five."""
PAUSE_S = 0.02
"""Set-points do not rise for this time after a break."""
FINE, JUMPED, SIGN, ANGLES_SWAPPED, PRESSURES_SWAPPED, FROZEN, BEYOND, ACTIVE, UNCHECKED, UNDECIDED = range(10)
"""Verdicts; UNDECIDED: of the step test alone, no fault."""


@inlined
def sample(s, spacing, position, now, dt):  # type: ignore[no-untyped-def]
    """Shift the samples of all joints (dt [s] after the last): speed, prediction, deviation and travel of each.

    now: (joints,) pressure [Pa].  Returns the time before the break and after it [s], 0 where nothing can be concluded,
    and whether the samples are too far apart for a momentum.
    """
    za, ab, bc, cx = spacing[0], spacing[1], spacing[2], spacing[3]
    per_za, per_ab, per_cx = 1.0 / za, 1.0 / ab, 1.0 / cx
    share = dt / (dt + NOISE_S)
    for i in range(len(position)):
        a, b, c, e = s[row.A, i], s[row.B, i], s[row.C, i], position[i]
        s[row.V, i] = (b - a) * per_ab
        s[row.JERK, i] = abs(s[row.V, i] - (a - s[row.Z, i]) * per_za) * bc
        s[row.PRED, i] = b + s[row.V, i] * bc
        s[row.DEV, i], s[row.TRAVEL, i] = c - s[row.PRED, i], e - c
        before = (s[row.X, i] - c) * per_cx
        surprise = abs(e - s[row.X, i] - before * dt)
        if surprise > _least(s, i) + STEP_RAD + (1.0 + SLACK) * abs(before) * dt:
            s[row.PAUSE, i], s[row.HOLD, i] = PAUSE_S, 1.0
        s[row.NOISE, i] += share * (min(surprise, STEP_RAD) - s[row.NOISE, i])
        s[row.Z, i], s[row.A, i], s[row.B, i], s[row.C, i], s[row.X, i] = a, b, c, s[row.X, i], e
        s[row.P_B, i], s[row.P_C, i], s[row.P_X, i], s[row.P_E, i] = s[row.P_C, i], s[row.P_X, i], s[row.P_E, i], now[i]
    spacing[0], spacing[1], spacing[2], spacing[3] = ab, bc, cx, dt
    longest = max(za, ab, bc, cx, dt)
    return bc, (cx + dt if longest <= LONGEST_S else 0.0), MOMENTUM_S < longest <= LONGEST_S


@inlined
def _least(s, i):  # type: ignore[no-untyped-def]
    return max(NOISES * s[row.NOISE, i], LEAST_RAD)


@without_arrays
def _travelled(s, c, i, nm, dt):  # type: ignore[no-untyped-def]
    """Largest deviation [rad] of joint i within dt [s] under nm [N m] and by an impact."""
    d, lag = (1.0 - WRONG) * c[row.D, i], c[row.J, i] / c[row.D, i]
    return STEP_RAD + nm / d * (dt - lag * (1.0 - math.exp(-dt / lag))) + (1.0 + RESTITUTION) * abs(s[row.V, i]) * dt


@without_arrays
def _balance(s, c, i, p):  # type: ignore[no-untyped-def]
    """What the pressure p [Pa] gives joint i at its predicted angle [N m]; an obstacle that holds it may let it go."""
    return torque(p, s[row.PRED, i], 0.0, c[row.A0, i], c[row.A1, i], c[row.A2, i], c[row.A3, i], 0.0)


@without_arrays
def _reach(s, c, partner, i, dt):  # type: ignore[no-untyped-def]
    """Largest deviation [rad] within dt [s] that the largest outside torque and the pressure give."""
    held = max(abs(_balance(s, c, i, s[row.P_B, i])), abs(_balance(s, c, i, s[row.P_C, i])))
    reach = _travelled(s, c, i, MAX_OUTSIDE_NM + (1.0 + WRONG) * held, dt)
    if partner[i] >= 0:
        reach += (1.0 + WRONG) * c[row.JC, i] / c[row.J, i] * abs(s[row.DEV, partner[i]])
    return reach


@without_arrays
def _own_reach(s, c, i, dt):  # type: ignore[no-untyped-def]
    """The same without outside torque and neighbour: what the pressure gives beyond the drag at the speed before."""
    drag, left = c[row.D, i] * s[row.V, i], 0.0
    for p in (s[row.P_B, i], s[row.P_C, i]):
        held = _balance(s, c, i, p)
        left = max(left, abs(held - drag) + WRONG * abs(held))
    return _travelled(s, c, i, left, dt)


@without_arrays
def _misses(s, i, speed, age, share):  # type: ignore[no-untyped-def]
    """Whether joint i has not travelled at a speed [rad/s] for age [s] since the break, but for a share of both."""
    slack = share * (abs(s[row.DEV, i]) + abs(speed) * age) + 0.5 * NOISES * s[row.NOISE, i]
    return abs(s[row.TRAVEL, i] - speed * age) > slack


@inlined
def _turn(s, i, age):  # type: ignore[no-untyped-def]
    """By how much [rad] joint i has left its speed: at the break, or for age [s] since."""
    return max(abs(s[row.DEV, i]), abs(s[row.TRAVEL, i] - s[row.V, i] * age))


@without_arrays
def _is_mirrored(s, c, partner, i, dt, age, rare):  # type: ignore[no-untyped-def]
    """Whether joint i has stepped to its mirrored motion: deviation after dt [s], travel for age [s] since."""
    v, dev, least, turn = s[row.V, i], abs(s[row.DEV, i]), _least(s, i), _turn(s, i, age)
    path, noticeable = abs(v) * dt, max(least, STEP_RAD)
    k = partner[i]
    if k >= 0 and _turn(s, k, age) > max(SLACK * turn, _least(s, k)):
        return False  # what its neighbour has met moves this joint too, by their common inertia
    if s[row.JERK, i] > noticeable + SLACK * path:
        return False  # after an impact, which may still be elastic
    off = math.inf
    for centre in (c[row.MIRROR, i], 0.0):
        off = min(off, abs(s[row.PRED, i] + s[row.DEV, i] - (centre - s[row.PRED, i])))
    if off > 0.2 * path + 0.03 * dev + 0.5 * least:
        return False
    if dev > noticeable + (1.0 + RESTITUTION) * path:
        if rare:
            return dev > _own_reach(s, c, i, dt) and abs(s[row.TRAVEL, i] + v * age) < STAYS * dev
        return abs(s[row.TRAVEL, i] + v * age) < 0.1 * dev + SLACK * abs(v) * age + 0.5 * least
    if rare or abs(v) * age < max(1.5 * least, STEP_RAD) or turn < SMOOTH * s[row.JERK, i]:
        return False
    first, second = s[row.C, i] - s[row.B, i], s[row.X, i] - s[row.C, i]
    if abs(second - first) > SLACK * abs(s[row.TRAVEL, i]):
        return False  # it has turned by and by
    thrown = (1.0 + WRONG) * c[row.JC, i] / c[row.J, i] * (_turn(s, k, age) + s[row.JERK, k]) if k >= 0 else 0.0
    back, path = -s[row.TRAVEL, i] if v > 0.0 else s[row.TRAVEL, i], abs(v) * age
    return REVERSED * path + thrown < back < path / REVERSED


@without_arrays
def _stepped(s, c, partner, i, dt, age, rare):  # type: ignore[no-untyped-def]
    """Verdict on the angle of joint i alone."""
    if _turn(s, i, age) < _least(s, i):
        return FINE
    if _is_mirrored(s, c, partner, i, dt, age, rare):
        return SIGN
    dev = abs(s[row.DEV, i])
    return JUMPED if dev > _reach(s, c, partner, i, dt) and abs(s[row.TRAVEL, i]) < STAYS * dev else FINE


@without_arrays
def _is_hit(s, c, i, k):  # type: ignore[no-untyped-def]
    """Whether an obstacle that stops joint i exchanges the speeds of i and k, by the inertia that they share.

    The impulse that changes the speed of i by one changes that of k by -JC / J_k. The speed of i does not grow by it.
    """
    share, own = c[row.JC, k] / c[row.J, k], abs(s[row.V, i])
    after = s[row.V, k] if s[row.V, i] > 0.0 else -s[row.V, k]
    slack = EXCHANGED * abs(s[row.V, i] - s[row.V, k])
    alike = (1.0 - WRONG) * share < 1.0 + EXCHANGED and (1.0 + WRONG) * share > 1.0 - EXCHANGED
    return alike and -RESTITUTION * own - slack < after < own + slack


@without_arrays
def _driven(s, c, partner, i, k, dt, age):  # type: ignore[no-untyped-def]
    """Lowest and highest mean change of speed [rad/s] of joint i over age [s], from dt [s] after the sample before.

    By what its pressure has changed since then (Eqs. 6, 8), and by a neighbour of common inertia, where it is not k.
    Where it is k, one obstacle that lets joint i go changes the speeds of both: then by all of its torque, too.
    """
    lag, low, high, before = c[row.J, i] / c[row.D, i], 0.0, 0.0, s[row.P_B, i]
    lever = max(c[row.A2, i] + c[row.A3, i] * s[row.PRED, i], 0.0)
    held = _balance(s, c, i, before) - c[row.D, i] * s[row.V, i] if partner[i] == k else 0.0
    for p in (s[row.P_C, i], s[row.P_X, i]):
        given = lever * (p - before)
        low, high = min(low, given, given + held), max(high, given, given + held)
    effect = 1.0 - lag / age * (math.exp(-dt / lag) - math.exp(-(dt + age) / lag))
    gain = (1.0 + WRONG) / (1.0 - WRONG) / c[row.D, i] * effect
    other, moved = partner[i], 0.0
    if other >= 0 and other != k:
        moved = (1.0 + WRONG) * c[row.JC, i] / c[row.J, i] * abs(s[row.TRAVEL, other] / age - s[row.V, other])
    return gain * low - moved, gain * high + moved


@without_arrays
def _is_own(s, c, partner, i, k, dt, age):  # type: ignore[no-untyped-def]
    """Whether joint i may have taken the speed of joint k by its own pressure, or by an obstacle that it has met."""
    change, dev, own, least = s[row.V, k] - s[row.V, i], s[row.DEV, i], abs(s[row.V, i]), _least(s, i)
    slack = EXCHANGED * abs(change)
    low, high = _driven(s, c, partner, i, k, dt, age)
    if low - slack <= change <= high + slack and low * dt - least <= dev <= high * dt + least:
        return True
    along = s[row.V, k] if s[row.V, i] > 0.0 else -s[row.V, k]
    return -RESTITUTION * own - slack < along < own - slack and abs(dev) < (1.0 + RESTITUTION) * own * dt + least


@without_arrays
def _crossed(s, i, k, least, dt, age):  # type: ignore[no-untyped-def]
    """Whether joints i and k have exchanged their speeds where their angles cross."""
    apart = abs(s[row.V, i] - s[row.V, k])
    if apart * age < least or abs(s[row.PRED, i] - s[row.PRED, k]) > least + apart * dt:
        return False
    if max(s[row.JERK, i], s[row.JERK, k]) > STEADY * apart * dt:
        return False  # the speeds changed as much before: pushes and impacts do so
    off = max(
        abs(s[row.PRED, k] - s[row.PRED, i] - s[row.DEV, i]),
        abs(s[row.PRED, i] - s[row.PRED, k] - s[row.DEV, k]),
        abs(s[row.TRAVEL, i] - s[row.V, k] * age),
        abs(s[row.TRAVEL, k] - s[row.V, i] * age),
    )
    return (
        off < EXCHANGED * apart * age
    )  # obstacles that stop both at once give back at most RESTITUTION of their speeds


@without_arrays
def _exchanged(s, c, partner, i, k, dt, age, rare):  # type: ignore[no-untyped-def]
    """Whether joints i and k have stepped to the predictions of each other."""
    dev, least = min(abs(s[row.DEV, i]), abs(s[row.DEV, k])), max(_least(s, i) + _least(s, k), STEP_RAD)
    hit = partner[i] == k and (_is_hit(s, c, i, k) or _is_hit(s, c, k, i))
    if min(dev, abs(s[row.PRED, i] - s[row.PRED, k])) < least:  # an exchange makes no step that shows
        return not rare and not hit and _crossed(s, i, k, least, dt, age)
    if s[row.DEV, i] * s[row.DEV, k] >= 0.0:
        return False
    if rare and dev < max(_own_reach(s, c, i, dt), _own_reach(s, c, k, dt)):
        return False
    if hit and dev < (1.0 + RESTITUTION) * max(abs(s[row.V, i]), abs(s[row.V, k])) * dt:
        return False  # an impact on one of them exchanges their speeds, by their common inertia
    ci, ck = s[row.PRED, i] + s[row.DEV, i], s[row.PRED, k] + s[row.DEV, k]
    if max(abs(ci - s[row.PRED, k]), abs(ck - s[row.PRED, i])) > EXCHANGED * dev + 0.5 * least:
        return False
    slack = STAYS if rare else SLACK
    return not _misses(s, i, s[row.V, k], age, slack) and not _misses(s, k, s[row.V, i], age, slack)


@inlined
def steps(s, c, partner, dt, age, rare):  # type: ignore[no-untyped-def]
    """Verdict, joint and other joint of the step test."""
    n, one, two = s.shape[1], 0, -1
    for i in range(n):
        if _turn(s, i, age) < _least(s, i):
            continue
        for k in range(i + 1, n):
            if _exchanged(s, c, partner, i, k, dt, age, rare):
                if not (_is_own(s, c, partner, i, k, dt, age) and _is_own(s, c, partner, k, i, dt, age)):
                    return ANGLES_SWAPPED, i, k
                one, two = i, k
    for i in range(n):
        verdict = _stepped(s, c, partner, i, dt, age, rare)
        if verdict != FINE:
            return verdict, i, -1
    return (UNDECIDED if two >= 0 else FINE), one, two
