"""On-line adaptation of the static map: recursive least squares with forgetting and bounds.

In free motion the filtered torque balance is zero (Eq. 8 without disturbance). Its scale cannot be seen without a
torque sensor, so a2 is kept, and a0, a1, a3 and d are adapted relative to it, as shares of their identified values:

    balance = a0 (1+x0) + a1 (1+x1) (phi - A phi_max) + a2 p + a3 (1+x2) p phi - d (1+x3) phi' - J phi'' = 0

A joint learns while it moves; it does not while unexcited, in contact, saturated or near the end of its range. The
covariance grows by forgetting no further than it began, so that long idling cannot make the map leap.
"""

from __future__ import annotations

from numba import njit

from hand_control.law_rows import G, S

MIN_SPEED_RAD_S = 0.05
"""A joint slower than this tells nothing that was not known."""
GATE = 3.0
STOPPING = 0.5
"""Standard deviations beyond which a balance teaches nothing; share of the filtered speed that a stop falls below."""
MARGIN_RAD = 0.035
"""Nearer to an end of its range, a joint may lean on the stop."""
_BALANCE_NM = 0.01
"""Standard deviation of the balance: what noise, filters and neglected accelerations leave.

Ticks within the filters' time constants tell the same thing once, however fast they come.
"""

_A0, _A1, _A2, _A3, _D = G["a0"], G["a1"], G["a2"], G["a3"], G["viscous"]
_PHI_MAX, _LOW, _HIGH, _MEMORY, _BOUND = G["phi_max"], G["low"], G["high"], G["memory"], G["adapt_bound"]
_T_OBS = G["observer_filter"]
_D0, _C00 = S["d_a0"], S["c00"]
_SPEED, _F2, _Q2, _CREEP, _CONTACT, _SUM = S["speed"], S["phi_2"], S["q_2"], S["creep"], S["contact"], S["sum"]
_BLIND, _THRESHOLD, _UNCERTAIN = S["blind"], G["threshold"], G["map_uncertainty"]
_BLIND_S = 0.1


@njit(cache=True)
def doubt(g, s, i):  # type: ignore[no-untyped-def]
    """Keep the map, but with the covariance one begins with."""
    for k in range(10):
        s[_C00 + k, i] = 0.0
    s[_C00, i] = s[_C00 + 4, i] = s[_C00 + 7, i] = s[_C00 + 9, i] = g[_UNCERTAIN, i] * g[_UNCERTAIN, i]


@njit(cache=True)
def forget(g, s, i):  # type: ignore[no-untyped-def]
    """Back to the identified map."""
    for k in range(4):
        s[_D0 + k, i] = 0.0
    doubt(g, s, i)


@njit(cache=True, inline="always", error_model="numpy")
def _regressors(g, s, i, speed):  # type: ignore[no-untyped-def]
    """Torque [N m] by which the balance answers each relative change."""
    return (
        g[_A0, i],
        g[_A1, i] * (s[_F2, i] - s[_CREEP, i] * g[_PHI_MAX, i]),
        g[_A3, i] * s[_Q2, i],
        -g[_D, i] * speed,
    )


@njit(cache=True, error_model="numpy")
def map_variance(g, s, i, speed):  # type: ignore[no-untyped-def]
    """Variance [(N m)^2] of the balance of joint i by what is not yet known of its map."""
    r0, r1, r2, r3 = _regressors(g, s, i, speed)
    own = s[_C00, i] * r0 * r0 + s[_C00 + 4, i] * r1 * r1 + s[_C00 + 7, i] * r2 * r2 + s[_C00 + 9, i] * r3 * r3
    pairs = r0 * (s[_C00 + 1, i] * r1 + s[_C00 + 2, i] * r2 + s[_C00 + 3, i] * r3)
    pairs += r1 * (s[_C00 + 5, i] * r2 + s[_C00 + 6, i] * r3) + s[_C00 + 8, i] * r2 * r3
    return max(own + 2.0 * pairs, 0.0)


@njit(cache=True, error_model="numpy")
def adapt(g, s, i, balance, variance, speed, saturated, dt):  # type: ignore[no-untyped-def]
    """One step for joint i at its filtered balance [N m], whose variance is known, and speed [rad/s]."""
    phi = s[_F2, i]
    # A closing joint that stops at once has met something; the filters still show it moving.
    stopped = speed > MIN_SPEED_RAD_S and s[_SPEED, i] < STOPPING * speed
    if stopped or saturated or s[_CONTACT, i] != 0.0 or s[_SUM, i] > 0.5 * g[_THRESHOLD, i]:
        s[_BLIND, i] = _BLIND_S  # the filters still hold what was then
    elif s[_BLIND, i] > 0.0:
        s[_BLIND, i] -= dt
    # What the map's uncertainty cannot explain is not the map: a contact that is not detected yet.
    if balance > 0.0 and balance * balance > GATE * GATE * variance:
        return
    if s[_BLIND, i] > 0.0 or abs(speed) < MIN_SPEED_RAD_S:
        return
    if phi < g[_LOW, i] + MARGIN_RAD or phi > g[_HIGH, i] - MARGIN_RAD:
        return
    r0, r1, r2, r3 = _regressors(g, s, i, speed)
    c00, c01, c02, c03 = s[_C00, i], s[_C00 + 1, i], s[_C00 + 2, i], s[_C00 + 3, i]
    c11, c12, c13 = s[_C00 + 4, i], s[_C00 + 5, i], s[_C00 + 6, i]
    c22, c23, c33 = s[_C00 + 7, i], s[_C00 + 8, i], s[_C00 + 9, i]
    k0 = c00 * r0 + c01 * r1 + c02 * r2 + c03 * r3
    k1 = c01 * r0 + c11 * r1 + c12 * r2 + c13 * r3
    k2 = c02 * r0 + c12 * r1 + c22 * r2 + c23 * r3
    k3 = c03 * r0 + c13 * r1 + c23 * r2 + c33 * r3
    noise = _BALANCE_NM * _BALANCE_NM * (1.0 + 2.0 * g[_T_OBS, i] / dt)
    per = 1.0 / (noise + r0 * k0 + r1 * k1 + r2 * k2 + r3 * k3)
    low, high = 1.0 / g[_BOUND, i] - 1.0, g[_BOUND, i] - 1.0
    s[_D0, i] = min(max(s[_D0, i] - k0 * per * balance, low), high)
    s[_D0 + 1, i] = min(max(s[_D0 + 1, i] - k1 * per * balance, low), high)
    # Adaptation must not take the leverage over the whole range away: a2 + a3 (1+x2) high > 0.
    most = min(high, max(-0.9 * g[_A2, i] / (g[_A3, i] * g[_HIGH, i]) - 1.0, 0.0)) if g[_A3, i] < 0.0 else high
    s[_D0 + 2, i] = min(max(s[_D0 + 2, i] - k2 * per * balance, low), most)
    s[_D0 + 3, i] = min(max(s[_D0 + 3, i] - k3 * per * balance, low), high)
    c00, c01, c02, c03 = c00 - k0 * k0 * per, c01 - k0 * k1 * per, c02 - k0 * k2 * per, c03 - k0 * k3 * per
    c11, c12, c13 = c11 - k1 * k1 * per, c12 - k1 * k2 * per, c13 - k1 * k3 * per
    c22, c23, c33 = c22 - k2 * k2 * per, c23 - k2 * k3 * per, c33 - k3 * k3 * per
    grow = 1.0
    if c00 + c11 + c22 + c33 < 4.0 * g[_UNCERTAIN, i] * g[_UNCERTAIN, i]:
        grow = 1.0 + dt / g[_MEMORY, i]
    s[_C00, i], s[_C00 + 1, i], s[_C00 + 2, i], s[_C00 + 3, i] = c00 * grow, c01 * grow, c02 * grow, c03 * grow
    s[_C00 + 4, i], s[_C00 + 5, i], s[_C00 + 6, i] = c11 * grow, c12 * grow, c13 * grow
    s[_C00 + 7, i], s[_C00 + 8, i], s[_C00 + 9, i] = c22 * grow, c23 * grow, c33 * grow
