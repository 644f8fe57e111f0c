"""On-line observer of the load and adaptation of the static map: recursive least squares with forgetting and bounds.

In free motion the filtered torque balance is zero (Eq. 8). A load is a state of its own: it is constant, and a0, which
has the same effect, is part of it. Without a torque sensor the scale of the balance cannot be observed, so a2 is kept,
and a1, a3 and d are estimated relative to it, as changes x of their identified values:

    balance = a0 + load + a1 (1+x1) (phi - A phi_max) + a2 p + a3 (1+x2) p phi - d (1+x3) phi' - J phi'' = 0

The errors of a1, a3 and d relative to a2 have the error of a2 in common, so their covariance begins correlated. What
x1 and x2 have in common is, on average, an error of a2: `law._torque_scale` corrects the torque limit by it, within
C.most_scale. The load follows a random walk, which lets it change while the map stays.

A joint is adapted while it moves freely; not at rest, in contact, saturated, or near a limit of its angle. At rest the
load alone follows a negative balance, which no obstacle causes. Forgetting lets the covariance grow to its initial
trace and no further, so that a long rest cannot make the estimate jump.
"""

from __future__ import annotations

from hand_control.declared import C, G, S, compiled, inlined


@compiled
def reset_covariance(g, s, i):  # type: ignore[no-untyped-def]
    """Keep the map of joint i and return its covariance to the initial one."""
    for k in range(10):
        s[S.c00 + k, i] = 0.0
    variance = g[G.map_uncertainty, i] * g[G.map_uncertainty, i]
    s[S.c00, i] = g[G.load_std, i] * g[G.load_std, i]
    s[S.c11, i] = s[S.c22, i] = s[S.c33, i] = (1.0 + C.common) * variance
    s[S.c12, i] = s[S.c13, i] = s[S.c23, i] = C.common * variance


@compiled
def reset_map(g, s, i):  # type: ignore[no-untyped-def]
    """Return joint i to the identified map and the configured variance of its balance."""
    s[S.misfit, i] = g[G.residual_std, i] * g[G.residual_std, i] / C.residual_factor
    for k in range(4):
        s[S.offset + k, i] = 0.0
    reset_covariance(g, s, i)


@inlined
def _regressors(g, s, i, speed):  # type: ignore[no-untyped-def]
    """Derivatives of the balance by the load [-] and by the three relative changes [N m]."""
    return (
        1.0,
        g[G.a1, i] * (s[S.phi_2, i] - s[S.creep, i] * g[G.phi_max, i]),
        g[G.a3, i] * s[S.q_2, i],
        -g[G.viscous, i] * speed,
    )


@compiled
def map_variance(g, s, i, speed):  # type: ignore[no-untyped-def]
    """Variance [(N m)^2] of the balance of joint i by the uncertainty of its map, at a filtered speed [rad/s]."""
    r0, r1, r2, r3 = _regressors(g, s, i, speed)
    own = s[S.c00, i] * r0 * r0 + s[S.c11, i] * r1 * r1 + s[S.c22, i] * r2 * r2 + s[S.c33, i] * r3 * r3
    pairs = r0 * (s[S.c01, i] * r1 + s[S.c02, i] * r2 + s[S.c03, i] * r3)
    pairs += r1 * (s[S.c12, i] * r2 + s[S.c13, i] * r3) + s[S.c23, i] * r2 * r3
    return max(own + 2.0 * pairs, 0.0)


@inlined
def _is_free_motion(g, s, i, balance, variance, speed, saturated, dt):  # type: ignore[no-untyped-def]
    """Whether the balance of this tick is that of a joint in free motion; counts down the pause after other ticks."""
    # The filtered speed of a joint that meets an obstacle falls late.
    stopped = speed > C.min_speed and s[S.speed, i] < C.stopping * speed
    if stopped or saturated or s[S.contact, i] != 0.0 or s[S.sum, i] > 0.5 * g[G.threshold, i]:
        s[S.pause, i] = C.pause_time
    elif s[S.pause, i] > 0.0:
        s[S.pause, i] -= dt
    # A balance that the uncertainty of the map cannot explain is a contact that is not detected yet.
    if balance > 0.0 and balance * balance > C.gate * C.gate * variance:
        return False
    if s[S.pause, i] > 0.0 or abs(speed) < C.min_speed:
        return False
    return g[G.low, i] + C.margin <= s[S.phi_2, i] <= g[G.high, i] - C.margin


@compiled
def adapt(g, s, i, balance, variance, speed, saturated, dt):  # type: ignore[no-untyped-def]
    """One step of joint i: filtered balance [N m], its variance [(N m)^2], filtered speed [rad/s], dt [s].

    Returns whether the map changed.
    """
    if not _is_free_motion(g, s, i, balance, variance, speed, saturated, dt):
        return False
    r0, r1, r2, r3 = _regressors(g, s, i, speed)
    c00, c01, c02, c03 = s[S.c00, i], s[S.c01, i], s[S.c02, i], s[S.c03, i]
    c11, c12, c13 = s[S.c11, i], s[S.c12, i], s[S.c13, i]
    c22, c23, c33 = s[S.c22, i], s[S.c23, i], s[S.c33, i]
    k0 = c00 * r0 + c01 * r1 + c02 * r2 + c03 * r3
    k1 = c01 * r0 + c11 * r1 + c12 * r2 + c13 * r3
    k2 = c02 * r0 + c12 * r1 + c22 * r2 + c23 * r3
    k3 = c03 * r0 + c13 * r1 + c23 * r2 + c33 * r3
    # Ticks within the time constant of the filters are correlated: a faster rate carries no more information.
    noise = C.balance_std * C.balance_std * (1.0 + 2.0 * g[G.observer_filter, i] / dt)
    per = 1.0 / (noise + r0 * k0 + r1 * k1 + r2 * k2 + r3 * k3)
    low, high = 1.0 / g[G.adapt_bound, i] - 1.0, g[G.adapt_bound, i] - 1.0
    x0, x1 = s[S.offset, i] - k0 * per * balance, s[S.d_a1, i] - k1 * per * balance
    x2, x3 = s[S.d_a3, i] - k2 * per * balance, s[S.d_viscous, i] - k3 * per * balance
    c00, c01, c02, c03 = c00 - k0 * k0 * per, c01 - k0 * k1 * per, c02 - k0 * k2 * per, c03 - k0 * k3 * per
    c11, c12, c13 = c11 - k1 * k1 * per, c12 - k1 * k2 * per, c13 - k1 * k3 * per
    c22, c23, c33 = c22 - k2 * k2 * per, c23 - k2 * k3 * per, c33 - k3 * k3 * per
    # Where the bound of a3 holds it back, the others take their most likely values given that bound.
    most = _highest_a3(g, i, high)
    excess = max(x2 - most, 0.0) / max(c22, C.least_variance)
    s[S.offset, i] = min(max(x0 - c02 * excess, -C.most_load), C.most_load)
    s[S.d_a1, i] = min(max(x1 - c12 * excess, low), high)
    s[S.d_a3, i] = min(max(x2 - c22 * excess, low), most)
    s[S.d_viscous, i] = min(max(x3 - c23 * excess, low), high)
    grow = 1.0
    if c11 + c22 + c33 < 3.0 * (1.0 + C.common) * g[G.map_uncertainty, i] * g[G.map_uncertainty, i]:
        grow = 1.0 + dt / g[G.memory, i]
    c00 = min(c00 + C.load_drift * C.load_drift * dt, g[G.load_std, i] * g[G.load_std, i])
    s[S.c00, i], s[S.c01, i], s[S.c02, i], s[S.c03, i] = c00 * grow, c01 * grow, c02 * grow, c03 * grow
    s[S.c11, i], s[S.c12, i], s[S.c13, i] = c11 * grow, c12 * grow, c13 * grow
    s[S.c22, i], s[S.c23, i], s[S.c33, i] = c22 * grow, c23 * grow, c33 * grow
    return True


@compiled
def learn_at_rest(g, s, i, balance, dt):  # type: ignore[no-untyped-def]
    """Follow the negative balance [N m] of joint i that stands, as far as friction does not explain it, as a load.

    The torque of an obstacle on which a joint rests is positive. A negative balance is a load that helps the joint: an
    object gets its torque in addition to that of the actuator. Not in torque mode, where what moves the hand is no
    load, nor near an end stop. Returns whether the load changed.
    """
    excess = balance + g[G.residual_std, i] + s[S.spread, i]
    if excess >= 0.0 or s[S.stood, i] < C.stand_time or s[S.contact, i] != 0.0 or g[G.torque_mode, i] != 0.0:
        return False
    if s[S.phi_2, i] < g[G.low, i] + C.margin:
        return False
    s[S.offset, i] = min(s[S.offset, i] - dt / (dt + C.still_time) * excess, C.most_load)
    # What was learnt is as uncertain as friction makes it.
    s[S.c00, i] = max(s[S.c00, i], g[G.residual_std, i] * g[G.residual_std, i])
    return True


@inlined
def _highest_a3(g, i, high):  # type: ignore[no-untyped-def]
    """Upper bound of the relative change of a3 that keeps leverage over the whole range: a2 + a3 (1+x2) high > 0."""
    if g[G.a3, i] >= 0.0:
        return high
    return min(high, max(-C.leverage_share * g[G.a2, i] / (g[G.a3, i] * g[G.high, i]) - 1.0, 0.0))
