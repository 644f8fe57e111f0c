"""Sensors that contradict the motion: angles that step, freeze, or have the wrong sign or place; exchanged pressures.

A plausible number alone is not believed. Four tests, all in elapsed time but for the run of equal readings:

    test          what no motion gives                                               finds
    step          a break of the angle without the momentum that a real one leaves   mirrored, negated, exchanged and
                  behind (DEV, TRAVEL below)                                         displaced angles, in motion
    passivity     a joint moved by an outside torque above MAX_OUTSIDE_NM            what the others have missed
    first motion  after arming where the wrong sign explains pose and speed better,  a sign that was wrong before
                  a motion against the one that the pressure asks for
    channel       equal readings in motion; an angle beyond an end stop              frozen, far off

Step. Over six samples z, a, b | c, d, e at least SPACING_S apart, the speed v of a, b predicts c; DEV is the deviation
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

Turns of a joint whose neighbour also turns (they share inertia), that was not in smooth motion before, or that a
constant acceleration explains are no evidence of a mirror.

Passivity. The environment gives energy only through pushes of at most MAX_OUTSIDE_NM, and by what an elastic obstacle
has stored, while the pressure falls. Each torque of Eq. 6 may be wrong by WRONG. Contacts and friction never count.

First motion. The measured pressure drives Eqs. 6 and 8, quasi-static, with nominal constants; until the joint has
followed, its set-point rises slowly. A sensor cannot change its sign without a step, so that the joint is not suspected
again. Two angles that were exchanged before arming make no step; the place watch asks the joints.

While a test is undecided, no set-point exceeds the one from before; the first rise of each joint is slow. References:
Brogliato, Nonsmooth Mechanics, 2016 (restitution); Willems, Dissipative dynamical systems, 1972 (passivity).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hand_control.place_watch import ALIKE, ENOUGH_S, NONE, RECENT_S, PlaceWatch, check_places, hold_places
from hand_model.arrays import Array
from hand_model.compile_cache import njit
from hand_model.description import Hand
from hand_model.statics import torque

MAX_OUTSIDE_NM = 0.25
"""Largest torque of a hand or an object on a joint that is taken for real: an actuator gives up to about 0.5 N m."""
WRONG = 0.3
"""Share by which each constant of the model may be wrong."""
RESTITUTION = 0.5
"""Largest share of its speed with which a joint comes back from an obstacle: the fingers are soft."""
SPACING_S, LONGEST_S = 0.004, 0.012
"""Least time between two samples of the step test, and the longest that lets a momentum be seen."""
LEAST_RAD, STEP_RAD, NOISES, NOISE_S = math.radians(0.1), math.radians(0.5), 6.0, 1.0
"""A break is larger than LEAST_RAD and NOISES times the mean second difference over NOISE_S; a step than STEP_RAD."""
SLACK = 0.3
"""Share of a deviation and of a path by which hypotheses may miss: acceleration, jitter of the stamps."""
REVERSED = 0.65
"""Share of the speed with which a joint turns back only where its sensor is mirrored; above RESTITUTION."""
STEADY = 0.4
"""Speeds that are exchanged were steady before: within this share of their difference, from sample to sample."""
SMOOTH = 8.0
"""A turn this many times the change of speed before it is none of a constant acceleration, which gives five."""
PAUSE_S = 0.02
"""Set-points do not rise for this time after a break."""
FROZEN_FRAMES, HELD_FRAMES, FROZEN_RAD_PER_S = 14, 3, 0.05
"""Bit-identical angles of a joint that moved at this speed. A channel repeats at most one in ten readings by chance at
any rate, so that many in a row are seen less often than once in a million hours."""
STOP_NM, BEYOND_RAD, BEYOND_S = 0.2, math.radians(1.5), 0.01
"""A joint is beyond its lower stop by more than this torque presses it and this angle, or by twice that beyond the
upper one, for longer than a glitch."""
LONGEST_LAG_S = 10.0
"""Drag is at least what stops a joint in this time: dry friction may be all that a described joint has."""
SPEED_S, SLOW_S, ACTIVE_RAD_PER_S, ACTIVE_S = 0.01, 0.1, 0.3, 0.04
POSE_NM = 0.012
"""Torque that pose and speed may leave unexplained by the pressure at arming: an error of the model, friction."""
PROVEN_RAD = math.radians(2.0)
"""A sign is proven, or refuted for ENOUGH_S, by a motion of PROVEN_RAD."""
OPPOSED = (0.45, 2.2)
"""Share of the predicted motion that is measured on a joint with the wrong sign whose constants are 30 % off."""
PRESSURE_S, LEAST_PA, UNEXPLAINED = 0.03, 1.2e4, 0.125
FINE, JUMPED, SIGN, ANGLES_SWAPPED, PRESSURES_SWAPPED, FROZEN, BEYOND, ACTIVE = range(8)
"""Verdicts."""
_KEYS = (
    "statics.a0_nm",
    "statics.a1_nm_per_rad",
    "statics.a2_nm_per_pa",
    "statics.a3_nm_per_pa_rad",
    "dynamics.inertia_kg_m2",
    "dynamics.viscous_friction_nm_s_per_rad",
    "dynamics.coupling_inertia_kg_m2",
    "end_stop.low_deg",
    "end_stop.high_deg",
)
_A0, _A1, _A2, _A3, _J, _D, _JC, _LOW, _HIGH, _MIRROR, _PRESSED = range(11)
_A, _B, _C, _X, _NOISE, _LAST, _RUN, _RUN_SPEED, _SPEED, _OUT_S, _ACTIVE_S, _PAUSE = range(12)
_CENTRE, _FROM, _MODEL, _W, _U, _DOUBTED, _SIGN_S, _BIAS = range(12, 20)
_PE, _PX, _PSWAP_S, _P_PROVEN, _P_LAST, _BELIEVED_PA, _HOLD, _V, _DEV, _TRAVEL, _PRED, _P_SLOW, _Z, _JERK = range(
    20, 34
)
_ROWS = 34


class Contradiction(NamedTuple):
    """What was found: a verdict, its joint, and the other joint of an exchange or -1.  size: of a step [rad]."""

    verdict: int
    joint: int
    other: int
    size: float


@njit(cache=True, error_model="numpy")
def _sample(s, spacing, position, dt):  # type: ignore[no-untyped-def]
    """Shift the samples of all joints (dt [s] after the last): speed, prediction, deviation and travel of each."""
    za, ab, bc, cx = spacing[0], spacing[1], spacing[2], spacing[3]
    for i in range(len(position)):
        a, b, c, e = s[_A, i], s[_B, i], s[_C, i], position[i]
        s[_V, i] = (b - a) / ab
        s[_JERK, i] = abs(s[_V, i] - (a - s[_Z, i]) / za) * bc
        s[_PRED, i] = b + s[_V, i] * bc
        s[_DEV, i], s[_TRAVEL, i] = c - s[_PRED, i], e - c
        before = (s[_X, i] - c) / cx
        surprise = abs(e - s[_X, i] - before * dt)
        if surprise > _least(s, i) + STEP_RAD + (1.0 + SLACK) * abs(before) * dt:
            s[_PAUSE, i], s[_HOLD, i] = PAUSE_S, 1.0
        s[_NOISE, i] += dt / (dt + NOISE_S) * (min(surprise, STEP_RAD) - s[_NOISE, i])
        s[_Z, i], s[_A, i], s[_B, i], s[_C, i], s[_X, i] = a, b, c, s[_X, i], e
    spacing[0], spacing[1], spacing[2], spacing[3] = ab, bc, cx, dt
    return bc, (cx + dt if max(za, ab, bc, cx, dt) <= LONGEST_S else 0.0)


@njit(cache=True, error_model="numpy")
def _least(s, i):  # type: ignore[no-untyped-def]
    return max(NOISES * s[_NOISE, i], LEAST_RAD)


@njit(cache=True, error_model="numpy")
def _reach(s, c, partner, i, dt):  # type: ignore[no-untyped-def]
    """Largest deviation [rad] within dt [s] that the largest outside torque and the neighbour's inertia give."""
    d, lag = (1.0 - WRONG) * c[_D, i], c[_J, i] / c[_D, i]
    phi, p = s[_PRED, i], s[_P_LAST, i]
    held = torque(p, phi, 0.0, c[_A0, i], c[_A1, i], c[_A2, i], c[_A3, i], 0.0)  # by an obstacle that may let it go
    most = MAX_OUTSIDE_NM + (1.0 + WRONG) * abs(held)
    reach = most / d * (dt - lag * (1.0 - math.exp(-dt / lag)))
    if partner[i] >= 0:
        reach += (1.0 + WRONG) * c[_JC, i] / c[_J, i] * abs(s[_DEV, partner[i]])
    return STEP_RAD + reach + (1.0 + RESTITUTION) * abs(s[_V, i]) * dt


@njit(cache=True, error_model="numpy")
def _misses(s, i, speed, age):  # type: ignore[no-untyped-def]
    """Whether joint i has not travelled at a speed [rad/s] for age [s] since the break."""
    slack = SLACK * (abs(s[_DEV, i]) + abs(speed) * age) + 0.5 * NOISES * s[_NOISE, i]
    return abs(s[_TRAVEL, i] - speed * age) > slack


@njit(cache=True, error_model="numpy")
def _turn(s, i, age):  # type: ignore[no-untyped-def]
    """By how much [rad] joint i has left its speed: at the break, or for age [s] since."""
    return max(abs(s[_DEV, i]), abs(s[_TRAVEL, i] - s[_V, i] * age))


@njit(cache=True, error_model="numpy")
def _is_mirrored(s, c, partner, i, dt, age):  # type: ignore[no-untyped-def]
    """Whether joint i has stepped to its mirrored motion: deviation after dt [s], travel for age [s] since."""
    v, dev, least, turn = s[_V, i], abs(s[_DEV, i]), _least(s, i), _turn(s, i, age)
    path, noticeable = abs(v) * dt, max(least, STEP_RAD)
    k = partner[i]
    if k >= 0 and _turn(s, k, age) > max(SLACK * turn, _least(s, k)):
        return False  # what its neighbour has met moves this joint too, by their common inertia
    if s[_JERK, i] > noticeable + SLACK * path:
        return False  # after an impact, which may still be elastic
    off = math.inf
    for centre in (c[_MIRROR, i], 0.0):
        off = min(off, abs(s[_PRED, i] + s[_DEV, i] - (centre - s[_PRED, i])))
    if off > 0.2 * path + 0.03 * dev + 0.5 * least:
        return False
    if dev > noticeable + (1.0 + RESTITUTION) * path:
        return abs(s[_TRAVEL, i] + v * age) < 0.1 * dev + SLACK * abs(v) * age + 0.5 * least
    if abs(v) * age < max(1.5 * least, STEP_RAD) or turn < SMOOTH * s[_JERK, i]:
        return False
    first, second = s[_C, i] - s[_B, i], s[_X, i] - s[_C, i]
    if abs(second - first) > SLACK * abs(s[_TRAVEL, i]):
        return False  # it has turned by and by
    return REVERSED < -s[_TRAVEL, i] / (v * age) < 1.0 / REVERSED


@njit(cache=True, error_model="numpy")
def _stepped(s, c, partner, i, dt, age):  # type: ignore[no-untyped-def]
    """Verdict on the angle of joint i alone."""
    if _turn(s, i, age) < _least(s, i):
        return FINE
    if _is_mirrored(s, c, partner, i, dt, age):
        return SIGN
    dev = abs(s[_DEV, i])
    return JUMPED if dev > _reach(s, c, partner, i, dt) and abs(s[_TRAVEL, i]) < 0.5 * dev else FINE


@njit(cache=True, error_model="numpy")
def _crossed(s, i, k, least, dt, age):  # type: ignore[no-untyped-def]
    """Whether joints i and k, which do not share inertia, have exchanged their speeds where their angles cross."""
    apart = abs(s[_V, i] - s[_V, k])
    if apart * age < least or abs(s[_PRED, i] - s[_PRED, k]) > least + apart * dt:
        return False
    if max(s[_JERK, i], s[_JERK, k]) > STEADY * apart * dt:
        return False  # the speeds changed as much before: pushes and impacts do so
    off = max(
        abs(s[_PRED, k] - s[_PRED, i] - s[_DEV, i]),
        abs(s[_PRED, i] - s[_PRED, k] - s[_DEV, k]),
        abs(s[_TRAVEL, i] - s[_V, k] * age),
        abs(s[_TRAVEL, k] - s[_V, i] * age),
    )
    return off < 0.2 * apart * age  # obstacles that stop both at once give back at most RESTITUTION of their speeds


@njit(cache=True, error_model="numpy")
def _exchanged(s, partner, i, k, dt, age):  # type: ignore[no-untyped-def]
    """Whether joints i and k have stepped to the predictions of each other."""
    dev, least = min(abs(s[_DEV, i]), abs(s[_DEV, k])), max(_least(s, i) + _least(s, k), STEP_RAD)
    if dev < least:
        return partner[i] != k and _crossed(s, i, k, least, dt, age)
    if s[_DEV, i] * s[_DEV, k] >= 0.0:
        return False
    if partner[i] == k and dev < (1.0 + RESTITUTION) * max(abs(s[_V, i]), abs(s[_V, k])) * dt:
        return False  # an impact on one of them exchanges their speeds, by their common inertia
    ci, ck = s[_PRED, i] + s[_DEV, i], s[_PRED, k] + s[_DEV, k]
    if max(abs(ci - s[_PRED, k]), abs(ck - s[_PRED, i])) > 0.2 * dev + 0.5 * least:
        return False
    return not _misses(s, i, s[_V, k], age) and not _misses(s, k, s[_V, i], age)


@njit(cache=True, error_model="numpy")
def _steps(s, c, partner, dt, age):  # type: ignore[no-untyped-def]
    """Verdict, joint and other joint of the step test."""
    n = s.shape[1]
    for i in range(n):
        if _turn(s, i, age) < _least(s, i):
            continue
        for k in range(i + 1, n):
            if _exchanged(s, partner, i, k, dt, age):
                return ANGLES_SWAPPED, i, k
    for i in range(n):
        verdict = _stepped(s, c, partner, i, dt, age)
        if verdict != FINE:
            return verdict, i, -1
    return FINE, 0, -1


@njit(cache=True, error_model="numpy")
def _channel(s, c, i, phi, dt):  # type: ignore[no-untyped-def]
    """Verdict on bit-identical angles and on the end stops."""
    if phi != s[_LAST, i]:
        s[_RUN, i], s[_RUN_SPEED, i] = 0.0, s[_SPEED, i]
    else:
        s[_RUN, i] += 1.0
    run = s[_RUN, i] if abs(s[_RUN_SPEED, i]) > FROZEN_RAD_PER_S else 0.0
    s[_SPEED, i] += dt / (dt + SPEED_S) * ((phi - s[_LAST, i]) / dt - s[_SPEED, i])
    s[_LAST, i] = phi
    s[_PAUSE, i] = max(s[_PAUSE, i] - dt, 0.0)
    s[_HOLD, i] = 1.0 if run >= HELD_FRAMES or s[_PAUSE, i] > 0.0 else 0.0
    if run >= FROZEN_FRAMES:
        return FROZEN
    beyond = phi < c[_LOW, i] - c[_PRESSED, i] or phi > c[_HIGH, i] + 2.0 * c[_PRESSED, i]
    s[_OUT_S, i] = s[_OUT_S, i] + dt if beyond else 0.0
    return BEYOND if s[_OUT_S, i] > BEYOND_S else FINE


@njit(cache=True, error_model="numpy")
def _is_active(s, c, i, phi, p, dt):  # type: ignore[no-untyped-def]
    """Whether joint i has moved for long enough with an outside torque beyond the largest one.

    An elastic obstacle gives back what it has stored only while the pressure falls.
    """
    a1, a2, a3, d, v = c[_A1, i], c[_A2, i], c[_A3, i], c[_D, i], s[_SPEED, i]
    outside = d * v - torque(p, phi, 0.0, c[_A0, i], a1, a2, a3, 0.0)
    terms = abs(c[_A0, i]) + abs(a1 * phi) + (abs(a2) + abs(a3 * phi)) * p + d * abs(v)
    s[_P_SLOW, i] += dt / (dt + SLOW_S) * (p - s[_P_SLOW, i])
    given_back = outside < 0.0 and p < s[_P_SLOW, i]
    moves = (
        not given_back
        and outside * v > 0.0
        and abs(v) > ACTIVE_RAD_PER_S
        and abs(outside) > MAX_OUTSIDE_NM + WRONG * terms
    )
    s[_ACTIVE_S, i] = s[_ACTIVE_S, i] + dt if moves else 0.0
    return s[_ACTIVE_S, i] > ACTIVE_S


@njit(cache=True, error_model="numpy")
def _first_motion(s, c, i, phi, p, dt):  # type: ignore[no-untyped-def]
    """Advance the motion that the pressure asks of joint i, and what is known of its sign; whether it is wrong."""
    at = s[_MODEL, i]
    balance = torque(p, at, 0.0, c[_A0, i], c[_A1, i], c[_A2, i], c[_A3, i], 0.0) - s[_BIAS, i]
    stiff = max(-c[_A1, i] - c[_A3, i] * p, 0.0)
    now = at + balance / c[_D, i] * dt / (1.0 + stiff / c[_D, i] * dt)
    s[_MODEL, i] = min(max(now, c[_LOW, i]), c[_HIGH, i])
    kept = 1.0 - dt / (dt + RECENT_S)
    s[_W, i] = kept * (s[_W, i] + s[_MODEL, i] - at)
    s[_U, i] = kept * (s[_U, i] + phi - s[_FROM, i])
    s[_FROM, i] = phi
    w, u = abs(s[_W, i]), s[_U, i] if s[_W, i] > 0.0 else -s[_U, i]
    if s[_DOUBTED, i] == 0.0 or w < PROVEN_RAD:
        return False
    if ALIKE[0] * w < u < ALIKE[1] * w:
        s[_DOUBTED, i] = 0.0
    opposed = -OPPOSED[1] * w < u < -OPPOSED[0] * w
    s[_SIGN_S, i] = s[_SIGN_S, i] + dt if opposed else 0.0
    return s[_SIGN_S, i] > ENOUGH_S


@njit(cache=True, error_model="numpy")
def _pressures(s, i, k, expected, wider, pressure, dt):  # type: ignore[no-untyped-def]
    """Whether the pressures of joints i and k are those that the set-points of the other one give."""
    share, least = dt / (dt + PRESSURE_S), 2.0 * (LEAST_PA + max(wider[i], wider[k])) ** 2
    as_is = (pressure[i] - expected[i]) ** 2 + (pressure[k] - expected[k]) ** 2
    swapped = (pressure[i] - expected[k]) ** 2 + (pressure[k] - expected[i]) ** 2
    s[_PE, i] += share * (as_is - s[_PE, i])
    s[_PX, i] += share * (swapped - s[_PX, i])
    step = max(abs(pressure[i] - s[_P_LAST, i]), abs(pressure[k] - s[_P_LAST, k]))
    if step > LEAST_PA or abs(pressure[i] - pressure[k]) < 2.0 * LEAST_PA:
        s[_P_PROVEN, i] = 0.0  # a sensor changes its place with a step only, or where the pressures are alike
    if s[_PX, i] > least and s[_PE, i] < UNEXPLAINED * s[_PX, i]:
        s[_P_PROVEN, i] += dt
    wrong = s[_P_PROVEN, i] < ENOUGH_S and s[_PE, i] > least and s[_PX, i] < UNEXPLAINED * s[_PE, i]
    s[_PSWAP_S, i] = s[_PSWAP_S, i] + dt if wrong else 0.0
    if wrong:
        s[_HOLD, i] = s[_HOLD, k] = 1.0
    return s[_PSWAP_S, i] > ENOUGH_S


@njit(cache=True, error_model="numpy")
def check_sensors(table, spacing, links, places, liquid, position, pressure, expected, wider, drive, dt):  # type: ignore[no-untyped-def]
    """Verdict, joint and other joint of a frame; updates the arrays of `SensorWatch.arrays` in place.

    position [rad], pressure, expected, wider, drive [Pa]: (joints,), see `SensorWatch.check`.  dt: [s].
    """
    n, verdict, joint, other = len(position), FINE, 0, -1
    s, c = table[:_ROWS], table[_ROWS:]
    partner, above, after = links[0], links[1], links[2]
    for i in range(n):
        found = _channel(s, c, i, position[i], dt)
        if found == FINE and _is_active(s, c, i, position[i], drive[i], dt):
            found = ACTIVE
        if _first_motion(s, c, i, position[i], drive[i], dt):
            found = SIGN
        if found != FINE:
            verdict, joint = found, i
    for i in range(n):
        k = above[i]
        if k >= 0 and not liquid and _pressures(s, i, k, expected, wider, pressure, dt):
            verdict, joint, other = PRESSURES_SWAPPED, i, k
    for i in range(n):
        s[_P_LAST, i] = pressure[i]
    pair = check_places(places, after, s[_W], s[_U], position, s[_MODEL], dt)
    if pair != NONE and verdict == FINE:
        verdict, joint, other = ANGLES_SWAPPED, pair, after[pair]
    spacing[4] += dt
    if spacing[4] < SPACING_S or verdict != FINE:
        return verdict, joint, other
    before, age = _sample(s, spacing, position, spacing[4])
    spacing[4] = 0.0
    return _steps(s, c, partner, before, age) if age > 0.0 else (FINE, 0, -1)


@njit(cache=True, error_model="numpy")
def hold_sensors(s, places, command, dt):  # type: ignore[no-untyped-def]
    """Limit the set-points of suspected joints in place to the last ones from before; whether one is lower now.

    s, places: SensorWatch.held.  command: (joints,) [Pa].  dt: [s] since the last frame.
    """
    limits = False
    for i in range(len(command)):
        if s[_HOLD, i] > 0.0:
            limits |= command[i] > s[_BELIEVED_PA, i]
            command[i] = min(command[i], s[_BELIEVED_PA, i])
        else:
            s[_BELIEVED_PA, i] = command[i]
    return hold_places(places, command, s[_P_LAST], dt) or limits


class SensorWatch:
    """Compares angles and pressures of one hand with its motion, frame by frame.

    arrays: the first arguments of `check_sensors`.  held: those of `hold_sensors`.  gap_s: longest time between frames
    [s] after which the tests go on.  elapsed_s: between the last two frames.
    """

    def __init__(self, hand: Hand) -> None:
        """Begin without evidence; `start` gives the first measurement."""
        sensors = hand.sensors
        self._joints = hand.joints
        pressed = STOP_NM / hand.row("end_stop.stiffness_nm_per_rad") + hand.row("end_stop.engagement_deg")
        constants = np.array([*(hand.row(key) for key in _KEYS), 2.0 * sensors.hall.zero_rad, pressed + BEYOND_RAD])
        constants[_D] = np.maximum(constants[_D], constants[_J] / LONGEST_LAG_S)
        table = np.concatenate([np.zeros((_ROWS, len(hand.joints))), constants])
        self._state, self._constants = table[:_ROWS], table[_ROWS:]
        self._channels = (sensors.angle_channel, sensors.pressure_channel)
        self._places = PlaceWatch(_next(sensors.angle_channel))
        self._spacing = np.zeros(5)
        self._period_s = 1.0 / hand.rate_hz
        self._liquid = bool(hand.row("hydraulic.share").max() > 0.0)
        links = np.array([hand.partner, _next(sensors.pressure_channel), self._places.after], dtype=np.int64)
        self.arrays = (table, self._spacing, links, self._places.state, self._liquid)
        self.held = (self._state, self._places.state)
        self._none = np.zeros(len(hand.joints))
        self.gap_s, self.elapsed_s = max(3.0 * self._period_s, 0.02), 0.0

    def start(self, position: Array, velocity: Array, pressure: Array) -> None:
        """Begin without evidence at position (n,) [rad], velocity (n,) [rad/s] and pressure (n,) [Pa].

        The joints may move: after a fault they are often armed again while they fall.
        """
        s, c = self._state, self._constants
        s[:] = 0.0
        self._restart(position, pressure)

        def balance(angle: Array) -> Array:
            nm: Array = np.asarray(torque(pressure, angle, 0.0, c[_A0], c[_A1], c[_A2], c[_A3], 0.0))
            return nm

        def unexplained(angle: Array, speed: Array) -> Array:
            # The first speed may be that of a step of the sensor: no more of it counts than the balance gives.
            nm = balance(angle)
            left: Array = nm - np.clip(c[_D] * speed, np.minimum(nm, 0.0), np.maximum(nm, 0.0))
            return left

        mirrored, negated = c[_MIRROR] - position, -position
        of_mirrored, of_negated = np.abs(unexplained(mirrored, -velocity)), np.abs(unexplained(negated, -velocity))
        as_measured = np.abs(balance(position) - c[_D] * velocity)
        other = np.where(of_mirrored < of_negated, mirrored, negated)
        doubted = (as_measured > POSE_NM) & (np.minimum(of_mirrored, of_negated) < as_measured)
        s[_DOUBTED], s[_NOISE] = doubted, LEAST_RAD
        s[_MODEL] = np.clip(np.where(doubted, other, position), c[_LOW], c[_HIGH])
        s[_BIAS] = np.clip(unexplained(s[_MODEL], np.where(doubted, -velocity, velocity)), -POSE_NM, POSE_NM)
        s[_BELIEVED_PA] = np.maximum(pressure, 0.0)
        self._places.start(pressure)

    def _restart(self, position: Array, pressure: Array) -> None:
        """Start the tests at rest; what was found is kept."""
        s = self._state
        s[[_Z, _A, _B, _C, _X, _LAST, _FROM]] = position
        s[_P_LAST] = s[_P_SLOW] = pressure
        s[[_RUN, _RUN_SPEED, _SPEED, _OUT_S, _ACTIVE_S, _W, _U, _SIGN_S, _PE, _PX, _PSWAP_S]] = 0.0
        self._spacing[:] = (math.inf, math.inf, math.inf, math.inf, 0.0)

    def check(
        self,
        position: Array,
        pressure: Array,
        expected: Array,
        driven: Array,
        elapsed_s: float,
        wider: Array | None = None,
    ) -> Contradiction | None:
        """What contradicts the motion, elapsed_s [s] after the last frame; None where nothing does.

        position (n,) [rad], pressure (n,) [Pa]: measured, finite.  expected: (n,) [Pa], of set-points and motion.
        driven: (n,) [Pa], of the set-points alone; it counts where a liquid lets the motion itself change the pressure.
        wider: (n,) [Pa], by how much expected may be wrong by what the motion displaces; None: by nothing.
        """
        drive = driven if self._liquid else pressure
        if elapsed_s <= 0.0 or elapsed_s > self.gap_s:
            self.elapsed_s = 0.0 if elapsed_s <= 0.0 else 3.0 * self._period_s
            if elapsed_s > 0.0:
                self._restart(position, drive)
                self._places.restart()
            return None
        self.elapsed_s = elapsed_s
        wide = self._none if wider is None else wider
        found = check_sensors(*self.arrays, position, pressure, expected, wide, drive, elapsed_s)
        return self.contradiction(*found)

    def contradiction(self, verdict: int, joint: int, other: int) -> Contradiction | None:
        """What `check_sensors` has found; None where nothing contradicts the motion."""
        return None if verdict == FINE else Contradiction(verdict, joint, other, float(self._state[_DEV, joint]))

    def hold(self, command: Array) -> bool:
        """Limit set-points (n,) [Pa] in place: none above the last one from before the present evidence.

        Returns whether one is lower now.
        """
        return bool(hold_sensors(*self.held, command, self.elapsed_s))

    def line(self, found: Contradiction) -> str:
        """What was found: joints, channels, evidence and what to check."""
        joint, other = self._joints[found.joint], self._joints[found.other]
        angle, pressure = (int(channel[found.joint]) for channel in self._channels)
        angles = f"{angle} and {int(self._channels[0][found.other])}"
        pressures = f"{pressure} and {int(self._channels[1][found.other])}"
        size_deg = math.degrees(abs(found.size))
        return {
            JUMPED: f"{joint}: its angle (channel {angle}) jumped by {size_deg:.1f} degrees, which no torque explains;"
            " check the sensor, its cable and its polarity",
            BEYOND: f"{joint}: its angle (channel {angle}) is beyond the end stop; check the polarity of the sensor and"
            " the calibration of the channel",
            FROZEN: f"{joint}: its angle (channel {angle}) stands still to the last bit while the joint moves; check"
            " the sensor, its cable and the converter",
            ACTIVE: f"{joint}: its angle (channel {angle}) moves without the pressure for it, as no outside torque of"
            f" {MAX_OUTSIDE_NM:g} N m explains; check the angle sensor, the pressure sensor (channel {pressure}) and"
            " the model",
            SIGN: f"{joint}: its angle (channel {angle}) falls where the pressure bends the joint; check the polarity"
            " of the sensor and the calibration of the channel",
            ANGLES_SWAPPED: f"{joint} and {other}: each angle (channels {angles}) is that of the other joint; check"
            " whether the sensors are exchanged",
            PRESSURES_SWAPPED: f"{joint} and {other}: each pressure (channels {pressures}) follows the set-point of"
            " the other joint; check whether sensors or tubes are exchanged",
        }[found.verdict]


def _next(channel: NDArray[np.int64]) -> NDArray[np.int64]:
    """The joint whose channel follows that of each joint, -1 where there is none; (joints,)."""
    of = {int(c): j for j, c in enumerate(channel)}
    return np.array([of.get(int(c) + 1, -1) for c in channel], dtype=np.int64)
