"""Small errors of pressure do not open the valve."""

from __future__ import annotations

import math

from hand_model.effects.effect import Effect, declare, inline
from hand_model.plant_parameters import Parameter

WIDTH, SOFTNESS = declare(
    Parameter("valve_deadband.width_pa", 0.0, 2e5, "error that opens nothing", 1.0, 0.0, 5e3),
    Parameter("valve_deadband.softness", 0.0, 1.0, "0 a sharp edge, 1 a gradual opening", 1.0, 0.0, 0.17),
)


@inline
def valve_error(w, i, error):  # type: ignore[no-untyped-def]
    """The valve feels the part of the error beyond the dead band, from a sharp edge or gradually."""
    width, soft = w[WIDTH, i], w[SOFTNESS, i]
    sharp = min(max(error, -width), width)
    gradual = width * error / math.sqrt(width * width + error * error + 1e-6)
    return error - sharp - soft * (gradual - sharp)


EFFECT = Effect(
    "valve_deadband",
    "valve",
    ("valve_deadband.width_pa", "valve_deadband.softness"),
    ((3e3, 0.0), (1.5e4, 0.0), (3e3, 1.0), (1.5e4, 1.0)),
    "the valve does not react to pressure errors below {width_pa} (softness of the edge {softness})",
    ("slow_triangle", "staircase"),
    "Overlap of a spool or a regulator's tolerance: little or no flow while the error is small.",
    "ISO 6358 valves with overlap, Beater, Pneumatic Drives, 2007",
    {"valve_error": valve_error},
    shape=("valve_deadband.softness",),
)
