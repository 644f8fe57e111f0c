"""The angle sensor reads a share too much or too little."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline
from hand_model.plant_parameters import Parameter

(GAIN,) = declare(Parameter("angle_gain.error", -0.5, 0.5, "relative error of the reading", 1.0, 0.0, 0.05))


@inline
def angle_reading(w, i, phi, h):  # type: ignore[no-untyped-def]
    """What the sensor says of a true angle."""
    return phi * (1.0 + w[GAIN, i])


EFFECT = Effect(
    "angle_gain",
    "angle_sensor",
    ("angle_gain.error",),
    ((0.05,), (-0.05,)),
    "the {angle} sensor reads {error} (relative) too much",
    ("stops", "staircase"),
    "Span error of the two-point calibration.",
    "Eq. 3, Martin et al. 2004",
    {"angle_reading": angle_reading},
)
