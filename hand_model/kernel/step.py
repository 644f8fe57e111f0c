"""One integration step: pressure, creep and motion. Second order, stable for any stiffness.

Pressure: rates at both ends of an explicit trial step give the rate's slope, and the exponential that belongs to it
gives the pressure; exact to fourth order where the rate is linear in the pressure, and exact where it is constant
(Hochbruck and Ostermann, Exponential integrators, Acta Numerica 19, 2010, with the slope as a secant). Limits and
sources that effects add are those at the pressure expected in the middle of the step.

Creep: each zone is linear, and prepared rates integrate it exactly at constant pressure (layout.prepare_rows).

Motion: the implicit midpoint rule, linearised about a predicted midpoint, so that any stiffness and damping is
stable. The damping of stops is fitted to its exponential decay, J z / (1 - exp(-z)) = J (1 + z/2 + z^2/12 ...), so that
a hard stop does not reverse the speed. Coupled phalanges are solved together by their mass matrix. Dry friction is an
impulse that stops a joint or slows it (dry_friction.py).

The set-point passes the dead time unchanged. Within a sample it changes once at most. A step that the change falls
into is split for the valve, so that a dead time need not be a whole number of steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from hand_model.kernel.dry_friction import along, goes_on_pair, rub_pair, soft, standstill
from hand_model.kernel.hooks import Hooks
from hand_model.kernel.inline import inline
from hand_model.kernel.layout import (
    ACCELERATION,
    ACTUATOR,
    AFTER,
    ARRIVAL,
    BEFORE,
    CREEP,
    FREE_AFTER,
    MEAN_CREEP,
    OMEGA,
    OVERRUN,
    PER_12_INERTIA,
    PHI,
    PHI_BEFORE,
    RISE,
    RUB,
    SPEED_AFTER,
    STEP_MASS,
    P,
    X,
)
from hand_model.kernel.rows import ROW, STEP_S
from hand_model.kernel.terms import limited_rate, terms

_J, _JC = ROW["dynamics.inertia_kg_m2"], ROW["dynamics.coupling_inertia_kg_m2"]
_SUPPLY = ROW["supply.pressure_pa"]
_TINY_RATE = 1e-12
"""[Pa^2/s^2] Keeps a quotient of rates finite where both vanish."""


def steps_per_sample(period_s: float, step_s: float = STEP_S) -> int:
    """Number of integration steps in one sample period [s], each at most step_s [s] long."""
    return max(1, math.ceil(period_s / step_s - 1e-9))


class Steps(NamedTuple):
    """Compiled steps with the hooks of a set of effects; each changes lane i of w in place."""

    pressure: Callable[..., Any]
    split_pressure: Callable[..., Any]
    inflow: Callable[..., Any]
    split_inflow: Callable[..., Any]
    creep: Callable[..., Any]
    single: Callable[..., Any]
    pair: Callable[..., Any]
    slide: Callable[..., Any]
    stick: Callable[..., Any]
    move: Callable[..., Any]
    remember: Callable[..., Any]
    rubs: bool
    """Whether joints have dry friction."""
    uses_rise: bool
    """Whether the pressure reads its rate in the step before, which the loop then keeps."""


@inline
def whole_below(x):  # type: ignore[no-untyped-def]
    """The largest whole number not above x, as a float."""
    whole = float(int(x))
    return whole - 1.0 if whole > x else whole


@inline
def deliver(w, i, before, after, lag_samples, steps):  # type: ignore[no-untyped-def]
    """Note which set-points reach the valve of lane i within a sample, and at which step the second one does.

    before, after: set-points [Pa] that were in force floor(lag) + 1 and floor(lag) samples ago. Returns the step that
    the change falls into, or -1 where it falls between two steps, up to 1e-9 of a step, or where nothing changes.
    """
    at = (lag_samples - whole_below(lag_samples)) * steps
    nearest = whole_below(at + 0.5)
    between = abs(at - nearest) < 1e-9 or before == after
    w[BEFORE, i], w[AFTER, i], w[ARRIVAL, i] = before, after, nearest if between else at
    return -1 if between else int(at)


@inline
def _arrived(w, i, n):  # type: ignore[no-untyped-def]
    """Share of the n-th step of a sample in which the second set-point is in force."""
    return min(max(n + 1.0 - w[ARRIVAL, i], 0.0), 1.0)


@inline
def _within_supply(w, i, u):  # type: ignore[no-untyped-def]
    return min(max(u, 0.0), w[_SUPPLY, i])


@inline
def exponential_mean(first, second):  # type: ignore[no-untyped-def]
    """Mean rate over a step whose rate is `first` at its start and `second` at the end of an explicit Euler step.

    first (e^z - 1) / z with z = second / first - 1, by the Pade approximation 1 / (1 - z/2 + z^2/12).
    """
    change = second - first
    square = first * first
    return first * square / (square - 0.5 * first * change + change * change * (1.0 / 12.0) + _TINY_RATE)


@inline
def valve_pressure(p, u, per_tau, vent, fill, h):  # type: ignore[no-untyped-def]
    """Pressure [Pa] after h [s] of the plain valve at p under the set-point u [Pa]: what a controller expects.

    per_tau: 1 / time constant [1/s].  vent, fill: limits of the rate [Pa/s].
    """
    first = limited_rate(u - p, per_tau, vent, fill)
    return p + h * exponential_mean(first, limited_rate(u - p - h * first, per_tau, vent, fill))


def assemble(hooks: Hooks) -> Steps:
    """The steps with the hooks of a set of effects (hooks.compose)."""
    equations = terms(hooks)
    valve_limits, valve_rate = equations.valve_limits, equations.valve_rate
    creep_rate, joint_torque = equations.creep_rate, equations.joint_torque
    hook_set_point, hook_source, hook_dry, hook_moved = hooks.set_point, hooks.pressure_source, hooks.dry, hooks.moved
    shapes, fed, replaced, rubs, moves, senses = (
        hooks.uses(hook) for hook in ("set_point", "pressure_source", "valve", "dry", "moved", "angle_sensor")
    )
    hook_sensor, hook_replaced, hook_valve = hooks.angle_sensor, hooks.valve_replaced, hooks.valve
    hook_trial = hooks.set_point_trial

    @inline
    def filled(w, i, p, u, e, h):  # type: ignore[no-untyped-def]
        """Pressure [Pa] after h [s] under the set-point u [Pa]."""
        middle = p + 0.5 * h * w[RISE, i]
        vent, fill = valve_limits(w, i, p, u, middle)
        source = hook_source(w, i, middle, e) if fed else 0.0
        first = valve_rate(w, i, u - p, vent, fill) + source
        second = valve_rate(w, i, u - p - h * first, vent, fill) + source
        return p + h * exponential_mean(first, second)

    @inline
    def pressure(w, i, n, e, h):  # type: ignore[no-untyped-def]
        """The valve's pressure [Pa] after the n-th step of a sample, and its mean over the step."""
        p = w[X + P, i]
        u_0, u_1 = w[BEFORE, i], w[AFTER, i]  # both are read: a conditional read would not be vectorised
        u = _within_supply(w, i, u_1 if _arrived(w, i, n) > 0.0 else u_0)
        after = filled(w, i, p, hook_set_point(w, i, u, p, e, h) if shapes else u, e, h)
        if replaced:
            after = hook_valve(w, i, p, u, e, h) if hook_replaced(w, i) else after
        return after, 0.5 * (p + after)

    @inline
    def _rising(w, i, first, second, h):  # type: ignore[no-untyped-def]
        """Mean rate of filling [Pa/s] of two parts of a step; that of a switching valve is taken from the last step."""
        rate = (max(first, 0.0) + max(second, 0.0)) / h
        return (max(w[RISE, i], 0.0) if hook_replaced(w, i) else rate) if replaced else rate

    @inline
    def inflow(w, i, n, e, h):  # type: ignore[no-untyped-def]
        """Rate of filling [Pa/s] that is expected in the n-th step of a sample; memory stays."""
        p, u_0, u_1 = w[X + P, i], w[BEFORE, i], w[AFTER, i]
        u = _within_supply(w, i, u_1 if _arrived(w, i, n) > 0.0 else u_0)
        return _rising(w, i, filled(w, i, p, hook_trial(w, i, u, p, e, h), e, h) - p, 0.0, h)

    @inline
    def split_inflow(w, i, n, e, h):  # type: ignore[no-untyped-def]
        """Like `inflow` for a step within which the set-point may change."""
        p, share = w[X + P, i], _arrived(w, i, n)
        u_0, u_1 = _within_supply(w, i, w[BEFORE, i]), _within_supply(w, i, w[AFTER, i])
        middle = filled(w, i, p, hook_trial(w, i, u_0, p, e, h), e, (1.0 - share) * h)
        after = filled(w, i, middle, hook_trial(w, i, u_1, p, e, h), e, share * h)
        return _rising(w, i, middle - p, after - middle, h)

    @inline
    def split_pressure(w, i, n, e, h):  # type: ignore[no-untyped-def]
        """Like `pressure` for a step within which the set-point may change: one part of it follows the other."""
        p, share = w[X + P, i], _arrived(w, i, n)
        u_0, u_1 = _within_supply(w, i, w[BEFORE, i]), _within_supply(w, i, w[AFTER, i])
        u = u_1 if share >= 1.0 else u_0 + share * (u_1 - u_0)
        first, second = u + (u_0 - u) if share < 1.0 else u, u + (u_1 - u) if share > 0.0 else u
        if shapes:
            first, second = hook_trial(w, i, first, p, e, h), hook_trial(w, i, second, p, e, h)
            hook_set_point(w, i, u, p, e, h)
        middle = filled(w, i, p, first, e, (1.0 - share) * h)
        linear = filled(w, i, middle, second, e, share * h)
        mean = 0.5 * ((1.0 - share) * (p + middle) + share * (middle + linear))
        if replaced:
            switched = hook_valve(w, i, p, u, e, h)
            if hook_replaced(w, i):
                return switched, 0.5 * (p + switched)
        return linear, mean

    @inline
    def creep(w, i, p, h):  # type: ignore[no-untyped-def]
        """The creeping ratio after h [s] at the actuator pressure p [Pa]."""
        return w[X + CREEP, i] + h * creep_rate(w, i, p, w[X + CREEP, i])

    @inline
    def _pushed(w, i, e, h):  # type: ignore[no-untyped-def]
        """Impulse without friction [N m s], diagonal of the step's matrix [kg m^2], friction's impulse, speed."""
        phi, omega, p, creeping = w[X + PHI, i], w[X + OMEGA, i], w[ACTUATOR, i], w[MEAN_CREEP, i]
        speed = omega + 0.5 * h * w[ACCELERATION, i]
        ahead = phi + 0.5 * h * omega
        torque, stiffness, damping, stop_damping = joint_torque(w, i, phi, ahead, omega, speed, p, creeping, e)
        rate = h * stop_damping
        mass = w[_J, i] + 0.5 * (h * damping + rate) + 0.25 * h * h * stiffness + rate * rate * w[PER_12_INERTIA, i]
        return h * torque, mass, h * hook_dry(w, i, ahead, speed, p) if rubs else 0.0, omega

    @inline
    def single(w, i, outside, e, h):  # type: ignore[no-untyped-def]
        """Speed of lane i alone after h [s]; outside: torque of what is not in its equations [N m]."""
        impulse, mass, rub, omega = _pushed(w, i, e, h)
        free = omega + (impulse + h * outside) / mass
        if not rubs:
            return free
        most = rub / mass
        braked = free - along(most, omega)
        share = standstill(omega, braked)
        slow = soft(free - share * along(most, omega), most - share * most)
        w[OVERRUN, i] = share * (slow - braked) if rub > 0.0 else 0.0
        return slow if rub > 0.0 else free

    @inline
    def slide(w, i, j, e_i, e_j, h):  # type: ignore[no-untyped-def]
        """Speeds of the coupled lanes i and j after h [s] while neither stops nor starts, and whether that holds. With
        friction, it leaves in rows what `stick` needs.
        """
        push_i, m_i, rub_i, omega_i = _pushed(w, i, e_i, h)
        push_j, m_j, rub_j, omega_j = _pushed(w, j, e_j, h)
        m_ij = w[_JC, i]
        per = 1.0 / (m_i * m_j - m_ij * m_ij)
        a = omega_i + (m_j * push_i - m_ij * push_j) * per
        b = omega_j + (m_i * push_j - m_ij * push_i) * per
        if not rubs:
            return a, b, True
        w[FREE_AFTER, i], w[STEP_MASS, i], w[RUB, i], w[OVERRUN, i] = a, m_i, rub_i, 0.0
        w[FREE_AFTER, j], w[STEP_MASS, j], w[RUB, j], w[OVERRUN, j] = b, m_j, rub_j, 0.0
        a, b, goes_on = goes_on_pair(omega_i, omega_j, a, b, m_i, m_j, m_ij, rub_i, rub_j)
        w[SPEED_AFTER, i], w[SPEED_AFTER, j] = a, b
        return a, b, goes_on

    @inline
    def stick(w, i, j):  # type: ignore[no-untyped-def]
        """What `slide` left, and where a joint of the pair stops or starts, the speeds after the step instead."""
        omega_i, omega_j, rub_i, rub_j = w[X + OMEGA, i], w[X + OMEGA, j], w[RUB, i], w[RUB, j]
        free_a, free_b, m_i, m_j = w[FREE_AFTER, i], w[FREE_AFTER, j], w[STEP_MASS, i], w[STEP_MASS, j]
        a, b, goes_on = goes_on_pair(omega_i, omega_j, free_a, free_b, m_i, m_j, w[_JC, i], rub_i, rub_j)
        slow_a, slow_b, over_a, over_b = rub_pair(omega_i, omega_j, free_a, free_b, m_i, m_j, w[_JC, i], rub_i, rub_j)
        w[OVERRUN, i], w[OVERRUN, j] = 0.0 if goes_on else over_a, 0.0 if goes_on else over_b
        w[SPEED_AFTER, i], w[SPEED_AFTER, j] = a if goes_on else slow_a, b if goes_on else slow_b

    @inline
    def pair(w, i, j, e_i, e_j, h):  # type: ignore[no-untyped-def]
        """Speeds of the coupled lanes i and j after h [s]."""
        a, b, goes_on = slide(w, i, j, e_i, e_j, h)
        if rubs and not goes_on:
            stick(w, i, j)
            return w[SPEED_AFTER, i], w[SPEED_AFTER, j]
        return a, b

    @inline
    def move(w, i, after, h, per_h):  # type: ignore[no-untyped-def]
        """Move lane i with the mean of its speed and the speed after the step, less what friction ends before that."""
        phi, omega = w[X + PHI, i], w[X + OMEGA, i]
        way, acceleration = omega + after, (after - omega) * per_h
        if rubs:  # a joint that stops does not go on as it stopped
            overrun = w[OVERRUN, i]
            way, acceleration = way - overrun, acceleration if overrun == 0.0 else 0.0
        w[PHI_BEFORE, i], w[X + PHI, i] = phi, phi + 0.5 * h * way
        w[X + OMEGA, i], w[ACCELERATION, i] = after, acceleration

    @inline
    def remember(w, i, h):  # type: ignore[no-untyped-def]
        """Let the effects keep the motion of this step in their memory."""
        if moves:
            hook_moved(w, i, w[PHI_BEFORE, i], w[X + PHI, i], h)
        if senses:
            hook_sensor(w, i, w[X + PHI, i], h)

    uses_rise = fed or replaced or hooks.uses("flow_limit")
    return Steps(
        pressure,
        split_pressure,
        inflow,
        split_inflow,
        creep,
        single,
        pair,
        slide,
        stick,
        move,
        remember,
        rubs,
        uses_rise,
    )
