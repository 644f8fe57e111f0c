"""The equations of one joint as functions of scalars: valve, creep, static torque, stops. Martin et al. 2004.

    p'    = clip((u - p) / tau, -vent rate, fill rate)                    the valve, first order with rate limits
    A'    = extension or recovery of the creeping ratio                   Eqs. 12 and 13
    M_a   = a0 + a1 (phi - A phi_max) + (a2 + a3 phi) p                   Eqs. 6 and 11
    J phi'' = M_a - d phi' - M_d                                          Eq. 8; M_d: load, stops, obstacle, partner

Two phalanges of a finger share inertia. In relative joint angles the mass matrix of the pair is
[[J_p, J_c], [J_c, J_d]]: J_p with the distal joint locked, J_d of the distal phalanx about its own joint, J_c the
coupling inertia, constant at its value in mid range. The thumb's opposition axis is perpendicular to its flexion axes
and is not coupled.

Torques are positive in flexion [N m], angles [rad], pressures gauge [Pa]. `w` holds rows of parameters, `i` is the
lane. `terms` compiles the equations with the hooks of a set of effects.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from hand_model.effects.force_curves import engaged
from hand_model.kernel.hooks import Hooks
from hand_model.kernel.inline import inline, inlined
from hand_model.kernel.layout import EXTENSION, PER_CONTACT, PER_STOP, PER_TAU, RECOVERY
from hand_model.kernel.rows import ROW
from hand_model.material import creep_rate
from hand_model.statics import torque

_static_torque, _creep_rate = inlined(torque), inlined(creep_rate)
_FILL, _VENT = ROW["valve.fill_rate_pa_per_s"], ROW["valve.vent_rate_pa_per_s"]
_A0, _A1, _A2, _A3 = (ROW[f"statics.{key}"] for key in ("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad"))
_PHI_MAX, _P_MIN = ROW["material.phi_max_deg"], ROW["material.p_min_pa"]
_B1, _B0 = ROW["material.b1_per_pa"], ROW["material.b0_per_pa"]
_D = ROW["dynamics.viscous_friction_nm_s_per_rad"]
_LOW, _HIGH = ROW["end_stop.low_deg"], ROW["end_stop.high_deg"]
_K_STOP, _D_STOP = ROW["end_stop.stiffness_nm_per_rad"], ROW["end_stop.damping_nm_s_per_rad"]
_W_STOP = ROW["end_stop.engagement_deg"]
_LOAD = ROW["constant_load.torque_nm"]
_CONTACT, _K_CONTACT = ROW["contact.angle_deg"], ROW["contact.stiffness_nm_per_rad"]
_D_CONTACT, _W_CONTACT = ROW["contact.damping_nm_s_per_rad"], ROW["contact.engagement_deg"]

Function = Callable[..., Any]


class Terms(NamedTuple):
    """Compiled equations with the hooks of a set of effects."""

    valve_limits: Function
    valve_rate: Function
    creep_rate: Function
    joint_torque: Function
    free_torque: Function


@inline
def one_sided_parts(depth, speed, stiffness, damping, engagement, per_engagement):  # type: ignore[no-untyped-def]
    """Torque [N m] of a stop pressed to a depth [rad] at a speed [rad/s] into it, its stiffness and its damping.

    Stiffness grows linearly over the engagement depth [rad], so the torque is continuously differentiable; the damper
    engages with it, and the stop never pulls (Hunt and Crossley, J. Appl. Mech. 42, 1975). All are 0 outside.
    per_engagement: 1 / engagement.
    """
    pressed, share = engaged(depth, engagement, per_engagement)
    total = stiffness * pressed + damping * share * speed
    acting = share if total > 0.0 else 0.0
    return max(total, 0.0), stiffness * acting, damping * acting


@inline
def one_sided(depth, speed, stiffness, damping, engagement):  # type: ignore[no-untyped-def]
    """Torque [N m] of a stop or an obstacle at a depth [rad] and a speed [rad/s] into it; a part of Eq. 8's M_d."""
    return one_sided_parts(depth, speed, stiffness, damping, engagement, 1.0 / engagement)[0]


@inline
def actuator_torque(w, i, p, phi, creep):  # type: ignore[no-untyped-def]
    """M_a [N m] of lane i at the pressure p [Pa], the angle phi [rad] and the creeping ratio (Eqs. 6 and 11)."""
    return _static_torque(p, phi, creep, w[_A0, i], w[_A1, i], w[_A2, i], w[_A3, i], w[_PHI_MAX, i])


@inline
def _stops(w, i, phi, omega):  # type: ignore[no-untyped-def]
    """Torque [N m] of both stops and the obstacle, their stiffness [N m/rad] and their damping [N m s/rad]."""
    k, d, width, per_width = w[_K_STOP, i], w[_D_STOP, i], w[_W_STOP, i], w[PER_STOP, i]
    high, high_k, high_d = one_sided_parts(phi - w[_HIGH, i], omega, k, d, width, per_width)
    low, low_k, low_d = one_sided_parts(w[_LOW, i] - phi, -omega, k, d, width, per_width)
    touch, touch_k, touch_d = one_sided_parts(
        phi - w[_CONTACT, i], omega, w[_K_CONTACT, i], w[_D_CONTACT, i], w[_W_CONTACT, i], w[PER_CONTACT, i]
    )
    return low - high - touch, high_k + low_k + touch_k, high_d + low_d + touch_d


@inline
def limited_rate(error, per_tau, vent, fill):  # type: ignore[no-untyped-def]
    """Pressure rate [Pa/s] of the valve at an error (set-point minus pressure) [Pa]; per_tau: 1 / tau [1/s]."""
    return min(max(error * per_tau, -vent), fill)


def terms(hooks: Hooks) -> Terms:
    """The equations with the hooks of a set of effects (hooks.compose)."""
    hook_error, hook_limit, hook_torque, hook_damping = hooks.valve_error, hooks.flow_limit, hooks.torque, hooks.damping
    bends, chokes, pushes, damps = (hooks.uses(hook) for hook in ("valve_error", "flow_limit", "torque", "damping"))
    hook_slows, slows = hooks.torque_damping, hooks.uses("torque_damping")

    @inline
    def valve_limits(w, i, p, u, middle):  # type: ignore[no-untyped-def]
        """Limits of venting and filling [Pa/s] in a step from p [Pa] to the set-point u [Pa], `middle` half way."""
        vent, fill = w[_VENT, i], w[_FILL, i]
        if not chokes:
            return vent, fill
        fills = u > p
        limit = hook_limit(w, i, fill if fills else vent, middle, fills)
        return vent if fills else limit, limit if fills else fill

    @inline
    def valve_rate(w, i, error, vent, fill):  # type: ignore[no-untyped-def]
        """Pressure rate [Pa/s] through the valve at an error (set-point minus pressure) [Pa]."""
        return limited_rate(hook_error(w, i, error) if bends else error, w[PER_TAU, i], vent, fill)

    @inline
    def creeping(w, i, p, creep):  # type: ignore[no-untyped-def]
        """Mean A' [1/s] over a step at constant p [Pa]: Eq. 12, whose zones the prepared rates integrate exactly."""
        return _creep_rate(p, creep, w[_P_MIN, i], w[_B1, i], w[EXTENSION, i], w[_B0, i], w[RECOVERY, i])

    @inline
    def joint_torque(w, i, phi, ahead, omega, speed, p, creep, e):  # type: ignore[no-untyped-def]
        """Torque on the joint at the predicted angle `ahead` [N m], its stiffness [N m/rad], its damping and that of
        stops and obstacle [N m s/rad].

        phi: angle at the start of the step, to which the effects' memory belongs; their torque is carried from there
        to `ahead` by its stiffness.  omega: speed at the start.  speed: predicted for the middle of the step, for
        terms that are not linear in it. Dry friction and the partner's inertia are not included.
        """
        stops, stop_stiffness, stop_damping = _stops(w, i, ahead, omega)
        viscous = w[_D, i] + hook_damping(w, i, speed) if damps else w[_D, i]
        total = actuator_torque(w, i, p, ahead, creep) - w[_LOAD, i] - viscous * omega + stops
        stiffness = stop_stiffness - w[_A1, i] - w[_A3, i] * p
        if pushes:
            added, added_stiffness = hook_torque(w, i, phi, speed, p, creep * w[_PHI_MAX, i], e)
            total += added - added_stiffness * (ahead - phi)
            stiffness += added_stiffness
        if slows:  # that torque is of the predicted speed, and damping acts from the speed at the start
            slowing = hook_slows(w, i, phi, speed, p, creep * w[_PHI_MAX, i], e)
            total += slowing * (speed - omega)
            viscous += slowing
        return total, max(stiffness, 0.0), viscous, stop_damping

    @inline
    def free_torque(w, i, phi, omega, p, creep, e):  # type: ignore[no-untyped-def]
        """Torque on the joint [N m] without stops, obstacle, dry friction and inertia."""
        added, _ = hook_torque(w, i, phi, omega, p, creep * w[_PHI_MAX, i], e)
        viscous = w[_D, i] + hook_damping(w, i, omega)
        return actuator_torque(w, i, p, phi, creep) + added - w[_LOAD, i] - viscous * omega

    return Terms(valve_limits, valve_rate, creeping, joint_torque, free_torque)
