"""The force sensor reads a share too much or too little."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline
from hand_model.plant_parameters import Parameter

(GAIN,) = declare(Parameter("fsr_gain.error", -0.9, 5.0, "relative error of the reading", 1.0, 0.0, 0.2))


@inline
def force_reading(w, i, force, h):  # type: ignore[no-untyped-def]
    """What the sensor says of a true force."""
    return force * (1.0 + w[GAIN, i])


EFFECT = Effect(
    "fsr_gain",
    "force_sensor",
    ("fsr_gain.error",),
    ((0.3,), (-0.3,)),
    "the force sensor reads {error} (relative) too much",
    ("taps", "closed_valve_push"),
    "Span error of a force sensing resistor.",
    "Eq. 5, Martin et al. 2004",
    {"force_reading": force_reading},
)
