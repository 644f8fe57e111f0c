"""The measured angle follows the joint with play."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.effects.operators import lag_constants, lagged
from hand_model.kernel.inline import inline, inlined
from hand_model.kernel.plant_rows import DEGREE, Parameter
from hand_model.statics import stiffness
from hand_model.statics import torque as static_torque

_static_torque, _stiffness = inlined(static_torque), inlined(stiffness)


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Halves of the gap behind and before the inertia, and constants of the contact at the ends of the former."""
    gap, contact_time, before = q[0], q[1], q[4]
    kept, slowness = lag_constants(contact_time, h)
    return 0.5 * gap * (1.0 - before), 0.5 * gap * before, kept, slowness


@inline
def _pushed(link, phi, half):  # type: ignore[no-untyped-def]
    """Angle of the driven side, pushed by the driving side at phi wherever the gap has closed."""
    return min(max(link, phi - half), phi + half)


@inline
def angle_sensor(q, m, phi, h):  # type: ignore[no-untyped-def]
    """Play operator between the angle of the actuator and the measured one; at its ends a soft contact.

    By the law there is a second play of a smaller gap, whose share the reading takes.
    """
    half, kept, slowness = q[9], q[11], q[12]
    link, before, inner = m
    after = lagged(link, _pushed(link, before, half), _pushed(link, phi, half), kept, slowness)
    return after, phi, _pushed(inner, phi, q[3] * half)


@inline
def angle_reading(q, m, phi):  # type: ignore[no-untyped-def]
    """Angle of the driven side, where the sensor sits."""
    driven, _, inner = m
    return driven - q[2] * (driven - inner)


@inline
def torque(q, m, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """Eq. 11 within a gap between actuator and link, whose inertia coasts there: less of it, as far as the gap reaches.

    The actuator has no inertia, so on either side of the gap its torque is that at the angle of its own side.
    """
    half, a0, a1, a2, a3 = q[10], q[5], q[6], q[7], q[8]
    whole, slope = _static_torque(p, phi, creep_angle, a0, a1, a2, a3, 1.0), _stiffness(p, a1, a3)
    most = half * abs(slope)
    inside = abs(whole) < most
    return -min(max(whole, -most), most), slope if inside else 0.0


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Way of the measured angle [rad] after a way x [rad] of the actuator beyond a reversal."""
    outer, inner = max(x - q[0], 0.0), max(x - q[0] * (q[4] + q[3] * (1.0 - q[4])), 0.0)
    return float(outer - q[2] * (outer - inner))


EFFECT = Effect(
    name="backlash",
    place="joint",
    parameters=(
        Parameter("backlash.gap_deg", 0.0, 30.0, "whole gap", DEGREE, 0.0, 1.0),
        Parameter(
            "backlash.contact_time_s", 0.0, 0.1, "in which the driven side follows at the gap's end", 1.0, 0.0, 2e-3
        ),
        Parameter("backlash.inner_share", 0.0, 1.0, "law: share of a second play", 1.0, 0.0, 0.2, law=True),
        Parameter("backlash.inner_gap", 0.0, 1.0, "law: its gap over the whole one", 1.0, 0.5, 0.3, law=True),
        Parameter(
            "backlash.before_inertia",
            0.0,
            1.0,
            "law: share of it before the inertia of the joint",
            1.0,
            0.0,
            0.5,
            law=True,
        ),
    ),
    reads=("statics.a0_nm", "statics.a1_nm_per_rad", "statics.a2_nm_per_pa", "statics.a3_nm_per_pa_rad"),
    prepared=("half", "half_before", "kept", "slowness"),
    memory={"driven": "angle", "driving": "angle", "inner": "angle"},
    law_memory=("inner",),
    hooks={"prepare": prepare, "torque": torque, "angle_sensor": angle_sensor, "angle_reading": angle_reading},
    keys=("backlash.gap_deg", "backlash.contact_time_s"),
    probes=((0.6, 0.0), (2.5, 0.0)),
    shape=("backlash.contact_time_s",),
    says="there is a backlash of {gap_deg} between actuator and sensor",
    experiments=("slow_triangle", "reversals"),
    doc="Play: after each reversal the reading stands still until the gap is crossed. By the law, the link may have the"
    " joint's inertia; it then coasts within the gap.",
    source="play operator and damped contact, Nordin and Gutman, Automatica 38(10), 2002",
    constitution=Constitution(
        acts_on="reading of the angle, and torque of the actuator",
        sign="behind the motion",
        passive=True,
        monotone="the reading does not go back while the joint goes on",
        memory="two plays; the angle of a link within a gap before its inertia",
        over=("angle",),
        coefficients=("backlash.inner_share", "backlash.inner_gap", "backlash.before_inertia"),
        quantity="the measured way after a reversal",
        unit="rad",
        curve=curve,
        source="sum of plays with non-negative weights, Krasnosel'skii and Pokrovskii, Systems with Hysteresis, 1989;"
        " dead zone of the torque before the inertia of the load, Nordin and Gutman, Automatica 38(10), 2002",
    ),
)
