"""Contact without force sensors: torque that the motion does not show, summed until it cannot be chance.

The filtered torque balance of Eq. 8 is what something outside holds against the joint. Its slow part is an error of
the model and is followed as a bias; the rest, in units of its standard deviation, is summed by Page's one-sided CUSUM,

    S' = max(0, S + (z - K)),   alarm at S > h,

and h follows from the wanted rate of false alarms by Siegmund's approximation of the average run length (Siegmund,
Sequential Analysis, 1985): ARL = (exp(2 K b) - 2 K b - 1) / (2 K^2), b = h + 1.166. The onset is where S last left 0.
"""

from __future__ import annotations

import math

from numba import njit
from scipy.optimize import brentq

from hand_control.law_rows import G, S

ALLOWANCE = 2.0
"""K: half the smallest contact worth detecting, in standard deviations."""
BIAS_TIME_S = 1.0
RELEASE_S = 0.1
"""A contact ends when the torque has been gone for this long."""
RELEASE = 1.5
"""Standard deviations of torque below which it is gone."""

MOVING_RAD_S, MOVING_S = 0.3, 0.1
"""A joint that is asked to move faster, and does so for so long, is not held by anything."""

_THRESHOLD, _T_OBS = G["threshold"], G["observer_filter"]
_BIAS, _SUM, _AGE, _CONTACT, _QUIET = S["bias"], S["sum"], S["age"], S["contact"], S["quiet"]
_MOVING = S["moving"]


@njit(cache=True, error_model="numpy")
def detect(g, s, i, balance, variance, dt):  # type: ignore[no-untyped-def]
    """One step for joint i at its filtered torque balance [N m], whose variance is known; dt [s]."""
    z = (balance - s[_BIAS, i]) / math.sqrt(variance)
    s[_AGE, i] = s[_AGE, i] + dt if s[_SUM, i] > 0.0 or s[_CONTACT, i] != 0.0 else 0.0
    # Samples within the filter's time constant tell the same thing once, however fast they come.
    weight = dt / (2.0 * g[_T_OBS, i])
    s[_SUM, i] = min(max(s[_SUM, i] + (z - ALLOWANCE) * weight, 0.0), 2.0 * g[_THRESHOLD, i])
    if s[_CONTACT, i] == 0.0:
        if s[_SUM, i] > g[_THRESHOLD, i]:
            s[_CONTACT, i], s[_QUIET, i] = 1.0, 0.0
        elif s[_SUM, i] < 0.5 * g[_THRESHOLD, i]:
            s[_BIAS, i] += dt / (dt + BIAS_TIME_S) * (balance - s[_BIAS, i])
        return
    s[_QUIET, i] = s[_QUIET, i] + dt if z < RELEASE else 0.0
    if s[_QUIET, i] > RELEASE_S:
        s[_CONTACT, i] = s[_SUM, i] = s[_AGE, i] = 0.0


@njit(cache=True)
def refuted(s, i, reference_speed, speed, dt):  # type: ignore[no-untyped-def]
    """Whether joint i, held to be in contact, moves on as asked: then the torque is an error of the map. Ends it."""
    follows = abs(reference_speed) > MOVING_RAD_S and speed * reference_speed > 0.5 * reference_speed * reference_speed
    s[_MOVING, i] = s[_MOVING, i] + dt if follows and s[_CONTACT, i] != 0.0 else 0.0
    if s[_MOVING, i] <= MOVING_S:
        return False
    s[_CONTACT, i] = s[_SUM, i] = s[_AGE, i] = s[_MOVING, i] = 0.0
    return True


def threshold(false_alarms_per_hour: float, observer_filter_s: float) -> float:
    """h for a rate of false alarms a joint; independent samples are two filter time constants apart."""
    run_length = max(3600.0 / false_alarms_per_hour / (2.0 * observer_filter_s), 10.0)

    def excess(h: float) -> float:
        b = 2.0 * ALLOWANCE * (h + 1.166)
        return math.log((math.exp(b) - b - 1.0) / (2.0 * ALLOWANCE**2)) - math.log(run_length)

    return float(brentq(excess, 0.0, 100.0))
