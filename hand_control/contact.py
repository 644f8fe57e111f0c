"""Contact without force sensors: a change detector on the torque balance of each joint.

The filtered torque balance of Eq. 8 is the torque that an obstacle holds against the joint. Its slow part is an error
of the model and is followed as a bias; the remainder, in units of its standard deviation, is summed by Page's
one-sided CUSUM,

    S' = max(0, S + (z - K)),   alarm at S > h,

with a smaller K where a joint does not follow a reference that flexes it, as at an obstacle. For this K, h follows from
the wanted rate of false alarms by Siegmund's approximation of the average run length (Sequential Analysis, 1985):
ARL = (exp(2 K b) - 2 K b - 1) / (2 K^2), b = h + 1.166. The onset is where S last left 0.

A joint whose partner may still meet an object keeps a part of its torque back for that impact.
"""

from __future__ import annotations

import math

from hand_control.declared import C, G, S, U, compiled, inlined

OVERSHOOT = 1.166
"""Mean excess of a sum of normal numbers over its threshold, in standard deviations, twice (Siegmund)."""
ITERATIONS = 100


@compiled
def detect(g, s, i, balance, variance, opens, lags, dt):  # type: ignore[no-untyped-def]
    """One step of joint i: filtered torque balance [N m], its variance [(N m)^2], dt [s].

    opens: the joint follows a reference that extends it; then it cannot come upon an obstacle that it bends against.
    lags: the joint does not follow a reference that flexes it clearly, as at an obstacle. Then a smaller torque
    suffices for a contact, and no torque of the obstacle becomes a bias.
    """
    # No obstacle causes a negative balance: friction and errors of the map do, which are as large on the other side.
    if balance < 0.0 and s[S.phi_2, i] > g[G.low, i] + C.margin:
        most = C.most_residual * g[G.residual_std, i]
        s[S.misfit, i] += dt / (dt + C.misfit_time) * (min(balance * balance, most * most) - s[S.misfit, i])
    z = (balance - s[S.bias, i]) / math.sqrt(variance)
    s[S.age, i] = s[S.age, i] + dt if s[S.sum, i] > 0.0 or s[S.contact, i] != 0.0 else 0.0
    # Samples within the time constant of the filters are correlated: a faster rate carries no more information.
    weight = dt / (2.0 * g[G.observer_filter, i])
    gain = (z - (C.allowance if lags else C.free_allowance)) * weight
    if opens and s[S.contact, i] == 0.0:
        gain = min(gain, 0.0)
    s[S.sum, i] = min(max(s[S.sum, i] + gain, 0.0), 2.0 * g[G.threshold, i])
    if s[S.contact, i] == 0.0:
        if s[S.sum, i] > g[G.threshold, i]:
            s[S.contact, i], s[S.released, i] = 1.0, 0.0
        elif s[S.sum, i] < 0.5 * g[G.threshold, i] and not (lags and balance > s[S.bias, i]):
            s[S.bias, i] += dt / (dt + C.bias_time) * (balance - s[S.bias, i])
        return
    s[S.released, i] = s[S.released, i] + dt if z < C.release else 0.0
    if s[S.released, i] > C.release_time:
        s[S.contact, i] = s[S.sum, i] = s[S.age, i] = 0.0


@inlined
def follows(reference_speed, speed):  # type: ignore[no-untyped-def]
    """Whether a joint moves as its reference does, which moves clearly; speeds in rad/s."""
    return (
        abs(reference_speed) > C.moving_speed
        and speed * reference_speed > C.moving_share * reference_speed * reference_speed
    )


@compiled
def contradicted_by_motion(s, i, reference_speed, speed, dt):  # type: ignore[no-untyped-def]
    """Whether joint i moves as commanded although contact is reported: the torque is an error of the map.

    Speeds in rad/s, dt in s. Ends the contact where it returns True.
    """
    moves = follows(reference_speed, speed) and s[S.contact, i] != 0.0
    s[S.moving, i] = s[S.moving, i] + dt if moves else 0.0
    if s[S.moving, i] <= C.moving_time:
        return False
    s[S.contact, i] = s[S.sum, i] = s[S.age, i] = s[S.moving, i] = 0.0
    return True


@inlined
def partner_impact(g, s, u, i):  # type: ignore[no-untyped-def]
    """Torque [N m] that joint i keeps back at an object, because its partner may meet one, too.

    A partner of inertia J that a spring k stops from the speed v has the acceleration v sqrt(k / J), and the coupling
    inertia passes it on. Nothing is kept back for a partner that rests or is in contact already, nor while the joint
    follows its reference.
    """
    partner = int(g[G.partner, i])
    if partner < 0 or s[S.contact, partner] != 0.0 or follows(u[U.speed, i], s[S.speed, i]):
        return 0.0
    if u[U.speed, partner] <= 0.0 or g[G.inertia, partner] <= 0.0 or u[U.limit, i] <= 0.0:
        return 0.0
    added = g[G.coupling, i] * u[U.speed, partner] * math.sqrt(g[G.contact_stiffness, partner] / g[G.inertia, partner])
    return min(added, C.most_impact * u[U.limit, i])


def threshold(false_alarms_per_hour: float, observer_filter_s: float) -> float:
    """Threshold h [-] for a rate of false alarms per joint; independent samples are two filter time constants apart.

    It is 0 where the wanted rate is higher than the detector has at h = 0.
    """
    run_length = 3600.0 / false_alarms_per_hour / (2.0 * observer_filter_s)
    wanted, least = 2.0 * C.allowance**2 * run_length, 2.0 * C.allowance * OVERSHOOT
    if math.exp(least) - least - 1.0 >= wanted:
        return 0.0
    b = least
    for _ in range(ITERATIONS):  # each shrinks the error by exp(-least) at least
        b = math.log(wanted + b + 1.0)
    return float(b / (2.0 * C.allowance) - OVERSHOOT)
