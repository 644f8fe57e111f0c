"""The joint warms up: rest torque and stiffness move towards new values."""

from __future__ import annotations

from hand_model.effects.effect import CREPT, Effect, declare, inline, remember
from hand_model.plant_parameters import PLANT_ROW, Parameter

SHIFT, SOFTENING, TAU = declare(
    Parameter("thermal_drift.torque_nm", -1.0, 1.0, "torque gained once warm", 1.0, 0.0, 0.01),
    Parameter("thermal_drift.softening", -1.0, 1.0, "share of the elasticity lost once warm", 1.0, 0.0, 0.1),
    Parameter("thermal_drift.time_constant_s", 5.0, 1e4, "of the warming", 1.0, 100.0),
)
_A1 = PLANT_ROW["statics.a1_nm_per_rad"]
WARMTH = remember()


@inline
def torque(w, i, phi, omega, p, e):  # type: ignore[no-untyped-def]
    """A rest torque and an elasticity that follow the warmth."""
    elastic = w[SOFTENING, i] * w[WARMTH, i] * w[_A1, i]
    return w[SHIFT, i] * w[WARMTH, i] - elastic * (phi - w[CREPT, i]), elastic


@inline
def moved(w, i, before, after, h):  # type: ignore[no-untyped-def]
    """Warmth goes from 0 to 1."""
    w[WARMTH, i] += (1.0 - w[WARMTH, i]) * (h / (w[TAU, i] + 0.5 * h))
    return 0.0


EFFECT = Effect(
    "thermal_drift",
    "material",
    ("thermal_drift.torque_nm", "thermal_drift.softening", "thermal_drift.time_constant_s"),
    ((0.01, 0.0, 20.0), (-0.01, 0.0, 20.0), (0.0, 0.1, 20.0), (0.01, 0.0, 150.0), (0.0, -0.1, 60.0)),
    "warming shifts the {torque} at rest by {torque_nm} and reduces the stiffness by {softening} (relative), with a"
    " time constant of {time_constant_s}",
    ("hold", "staircase"),
    "First-order warming that shifts the static map.",
    "lumped thermal model of one capacity",
    {"torque": torque, "moved": moved},
    {"thermal_drift.time_constant_s": 1.0},
    shape=("thermal_drift.time_constant_s",),
)
