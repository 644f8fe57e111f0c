"""The weight of the phalanx, which Eq. 8 leaves out."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline, sine_cosine
from hand_model.plant_parameters import Parameter

SINE, COSINE = declare(
    Parameter("gravity.sine_nm", -5.0, 5.0, "torque against flexion at 90 degrees", 1.0, 0.0, 0.01),
    Parameter("gravity.cosine_nm", -5.0, 5.0, "torque against flexion at 0 degrees", 1.0, 0.0, 0.01),
)


@inline
def torque(w, i, phi, omega, p, e):  # type: ignore[no-untyped-def]
    """m g l sin(phi + attitude) in two parts."""
    s, c = sine_cosine(phi)
    return -(w[SINE, i] * s + w[COSINE, i] * c), w[SINE, i] * c - w[COSINE, i] * s


EFFECT = Effect(
    "gravity",
    "joint",
    ("gravity.sine_nm", "gravity.cosine_nm"),
    ((0.01, 0.0), (-0.01, 0.0), (0.0, 0.01), (0.0, -0.01)),
    "gravity acts with {sine_nm} times the sine and {cosine_nm} times the cosine of the {angle}",
    ("staircase", "second_attitude"),
    "Weight of the phalanx at a fixed attitude of the hand.",
    "rigid pendulum",
    {"torque": torque},
)
