"""Small errors of pressure do not open the valve."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline
from hand_model.plant_parameters import Parameter

(WIDTH,) = declare(Parameter("valve_deadband.width_pa", 0.0, 2e5, "error that opens nothing", 1.0, 0.0, 5e3))


@inline
def valve_error(w, i, error):  # type: ignore[no-untyped-def]
    """The valve feels the part of the error beyond the dead band."""
    return error - min(max(error, -w[WIDTH, i]), w[WIDTH, i])


EFFECT = Effect(
    "valve_deadband",
    "valve",
    ("valve_deadband.width_pa",),
    ((3e3,), (1.5e4,)),
    "the valve does not react to pressure errors below {width_pa} Pa",
    ("slow_triangle", "staircase"),
    "Overlap of a spool or a regulator's tolerance: no flow while the error is small.",
    "ISO 6358 valves with overlap, Beater, Pneumatic Drives, 2007",
    {"valve_error": valve_error},
)
