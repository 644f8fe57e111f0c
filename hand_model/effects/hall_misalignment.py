"""Magnet and sensor are not centred: the reading has harmonic errors."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline, sine_cosine
from hand_model.plant_parameters import DEGREE, Parameter

SINE, COSINE, SINE_2, COSINE_2 = declare(
    Parameter("hall_misalignment.sine_deg", -20.0, 20.0, "first harmonic of the error", DEGREE, 0.0, 1.0),
    Parameter("hall_misalignment.cosine_deg", -20.0, 20.0, "first harmonic of the error", DEGREE, 0.0, 1.0),
    Parameter("hall_misalignment.sine_2_deg", -20.0, 20.0, "second harmonic of the error", DEGREE, 0.0, 1.0),
    Parameter("hall_misalignment.cosine_2_deg", -20.0, 20.0, "second harmonic of the error", DEGREE, 0.0, 1.0),
)


@inline
def angle_reading(w, i, phi, h):  # type: ignore[no-untyped-def]
    """Harmonics of the angle on top of it."""
    s, c = sine_cosine(phi)
    first = w[SINE, i] * s + w[COSINE, i] * c
    return phi + first + w[SINE_2, i] * 2.0 * s * c + w[COSINE_2, i] * (c * c - s * s)


EFFECT = Effect(
    "hall_misalignment",
    "angle_sensor",
    tuple(f"hall_misalignment.{key}_deg" for key in ("sine", "cosine", "sine_2", "cosine_2")),
    ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
    "the {angle} reading has harmonic errors: {sine_deg} sin + {cosine_deg} cos of the {angle},"
    " {sine_2_deg} sin + {cosine_2_deg} cos of twice the {angle}",
    ("stops", "staircase"),
    "Eccentric or tilted magnet: harmonics of the angle in its reading.",
    "Eq. 1 with harmonics; harmonic error of magnetic encoders",
    {"angle_reading": angle_reading},
)
