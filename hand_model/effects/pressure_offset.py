"""The pressure sensor reads a constant too much or too little."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline
from hand_model.plant_parameters import Parameter

(OFFSET,) = declare(Parameter("pressure_offset.offset_pa", -2e5, 2e5, "read minus true pressure", 1.0, 0.0, 5e3))


@inline
def pressure_reading(w, i, p):  # type: ignore[no-untyped-def]
    """What the sensor says of a true pressure."""
    return p + w[OFFSET, i]


@inline
def pressure_true(w, i, reading):  # type: ignore[no-untyped-def]
    """The true pressure behind a reading."""
    return reading - w[OFFSET, i]


EFFECT = Effect(
    "pressure_offset",
    "pressure_sensor",
    ("pressure_offset.offset_pa",),
    ((5e3,), (-5e3,)),
    "the {pressure} sensor reads {offset_pa} too much",
    ("staircase", "hold"),
    "Zero error of a piezoresistive sensor.",
    "IEC 61298-2, zero error",
    {"pressure_reading": pressure_reading, "pressure_true": pressure_true},
)
