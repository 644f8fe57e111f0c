"""Contact without force sensors: a change detector on the torque balance of each joint.

The filtered torque balance of Eq. 8 is the torque that an obstacle holds against the joint. Its slow part is an error
of the model and is followed as a bias; the remainder, in units of its standard deviation, is summed by Page's
one-sided CUSUM,

    S' = max(0, S + (z - K)),   alarm at S > h,

and h follows from the wanted rate of false alarms by Siegmund's approximation of the average run length (Siegmund,
Sequential Analysis, 1985): ARL = (exp(2 K b) - 2 K b - 1) / (2 K^2), b = h + 1.166. The onset is where S last left 0.
"""

from __future__ import annotations

import math

from scipy.optimize import brentq

from hand_control.declared import C, G, S, compiled


@compiled
def detect(g, s, i, balance, variance, dt):  # type: ignore[no-untyped-def]
    """One step of joint i: filtered torque balance [N m], its variance [(N m)^2], dt [s]."""
    z = (balance - s[S.bias, i]) / math.sqrt(variance)
    s[S.age, i] = s[S.age, i] + dt if s[S.sum, i] > 0.0 or s[S.contact, i] != 0.0 else 0.0
    # Samples within the time constant of the filters are correlated: a faster rate carries no more information.
    weight = dt / (2.0 * g[G.observer_filter, i])
    s[S.sum, i] = min(max(s[S.sum, i] + (z - C.allowance) * weight, 0.0), 2.0 * g[G.threshold, i])
    if s[S.contact, i] == 0.0:
        if s[S.sum, i] > g[G.threshold, i]:
            s[S.contact, i], s[S.released, i] = 1.0, 0.0
        elif s[S.sum, i] < 0.5 * g[G.threshold, i]:
            s[S.bias, i] += dt / (dt + C.bias_time) * (balance - s[S.bias, i])
        return
    s[S.released, i] = s[S.released, i] + dt if z < C.release else 0.0
    if s[S.released, i] > C.release_time:
        s[S.contact, i] = s[S.sum, i] = s[S.age, i] = 0.0


@compiled
def contradicted_by_motion(s, i, reference_speed, speed, dt):  # type: ignore[no-untyped-def]
    """Whether joint i moves as commanded although contact is reported: the torque is an error of the map.

    Speeds in rad/s, dt in s. Ends the contact where it returns True.
    """
    follows = (
        abs(reference_speed) > C.moving_speed
        and speed * reference_speed > C.moving_share * reference_speed * reference_speed
    )
    s[S.moving, i] = s[S.moving, i] + dt if follows and s[S.contact, i] != 0.0 else 0.0
    if s[S.moving, i] <= C.moving_time:
        return False
    s[S.contact, i] = s[S.sum, i] = s[S.age, i] = s[S.moving, i] = 0.0
    return True


def threshold(false_alarms_per_hour: float, observer_filter_s: float) -> float:
    """Threshold h for a rate of false alarms per joint; independent samples are two filter time constants apart.

    It is 0 where the wanted rate is higher than the detector has at h = 0.
    """
    run_length = 3600.0 / false_alarms_per_hour / (2.0 * observer_filter_s)

    def excess(h: float) -> float:
        b = 2.0 * C.allowance * (h + 1.166)
        return math.log((math.exp(b) - b - 1.0) / (2.0 * C.allowance**2)) - math.log(run_length)

    return 0.0 if excess(0.0) > 0.0 else float(brentq(excess, 0.0, 100.0))
