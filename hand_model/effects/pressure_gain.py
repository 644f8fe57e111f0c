"""The pressure sensor reads a share too much or too little."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline
from hand_model.plant_parameters import Parameter

(GAIN,) = declare(Parameter("pressure_gain.error", -0.5, 0.5, "relative error of the span", 1.0, 0.0, 0.005))


@inline
def pressure_reading(w, i, p):  # type: ignore[no-untyped-def]
    """What the sensor says of a true pressure."""
    return p * (1.0 + w[GAIN, i])


@inline
def pressure_true(w, i, reading):  # type: ignore[no-untyped-def]
    """The true pressure behind a reading."""
    return reading / (1.0 + w[GAIN, i])


EFFECT = Effect(
    "pressure_gain",
    "pressure_sensor",
    ("pressure_gain.error",),
    ((0.04,), (-0.04,)),
    "the {pressure} sensor reads {error} (relative) too much",
    ("staircase",),
    "Span error of a piezoresistive sensor.",
    "IEC 61298-2, span error",
    {"pressure_reading": pressure_reading, "pressure_true": pressure_true},
)
