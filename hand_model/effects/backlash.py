"""The measured angle follows the joint with play."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.effects.operators import lag_constants, lagged
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import DEGREE, Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Half of the gap, and constants of the contact at its ends."""
    gap, contact_time = q[0], q[1]
    kept, slowness = lag_constants(contact_time, h)
    return 0.5 * gap, kept, slowness


@inline
def _pushed(link, phi, half):  # type: ignore[no-untyped-def]
    """Angle of the driven side, pushed by the driving side at phi wherever the gap has closed."""
    return min(max(link, phi - half), phi + half)


@inline
def angle_sensor(q, m, phi, h):  # type: ignore[no-untyped-def]
    """Play operator between the angle of the actuator and the measured one; at its ends a soft contact.

    The law adds a second play of a smaller gap, whose share the reading takes.
    """
    half, kept, slowness = q[4], q[5], q[6]
    link, before, inner = m
    after = lagged(link, _pushed(link, before, half), _pushed(link, phi, half), kept, slowness)
    return after, phi, _pushed(inner, phi, q[3] * half)


@inline
def angle_reading(q, m, phi):  # type: ignore[no-untyped-def]
    """Angle of the driven side, where the sensor sits."""
    driven, _, inner = m
    return driven - q[2] * (driven - inner)


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Way of the measured angle [rad] after a way x [rad] of the actuator beyond a reversal."""
    outer, inner = max(x - q[0], 0.0), max(x - q[3] * q[0], 0.0)
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
    ),
    prepared=("half", "kept", "slowness"),
    memory={"driven": "angle", "driving": "angle", "inner": "angle"},
    law_memory=("inner",),
    hooks={"prepare": prepare, "angle_sensor": angle_sensor, "angle_reading": angle_reading},
    keys=("backlash.gap_deg", "backlash.contact_time_s"),
    probes=((0.6, 0.0), (2.5, 0.0)),
    shape=("backlash.contact_time_s",),
    says="there is a backlash of {gap_deg} between actuator and sensor",
    experiments=("slow_triangle", "reversals"),
    doc="Play: after each reversal the reading stands still until the gap is crossed.",
    source="play operator and damped contact, Nordin and Gutman, Automatica 38(10), 2002",
    constitution=Constitution(
        acts_on="reading of the angle",
        sign="behind the motion",
        passive=True,
        monotone="the reading does not go back while the joint goes on",
        memory="two plays",
        over=("angle",),
        coefficients=("backlash.inner_share", "backlash.inner_gap"),
        quantity="the measured way after a reversal",
        unit="rad",
        curve=curve,
        source="sum of plays with non-negative weights, Krasnosel'skii and Pokrovskii, Systems with Hysteresis, 1989",
    ),
)
