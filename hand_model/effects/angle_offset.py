"""The angle sensor reads a constant too much or too little."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline
from hand_model.plant_parameters import DEGREE, Parameter

(OFFSET,) = declare(Parameter("angle_offset.offset_deg", -60.0, 60.0, "read minus true angle", DEGREE, 0.0, 2.0))


@inline
def angle_reading(w, i, phi, h):  # type: ignore[no-untyped-def]
    """What the sensor says of a true angle."""
    return phi + w[OFFSET, i]


EFFECT = Effect(
    "angle_offset",
    "angle_sensor",
    ("angle_offset.offset_deg",),
    ((2.0,), (-2.0,)),
    "the {angle} sensor reads {offset_deg} too much",
    ("stops", "staircase"),
    "Zero error of the Hall sensor.",
    "Eq. 1, phi_0, Martin et al. 2004",
    {"angle_reading": angle_reading},
)
