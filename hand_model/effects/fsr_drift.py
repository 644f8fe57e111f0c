"""The force reading creeps under load."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline, remember
from hand_model.plant_parameters import Parameter

SHARE, TAU = declare(
    Parameter("fsr_drift.share", -0.9, 5.0, "of the force added under lasting load", 1.0, 0.0, 0.2),
    Parameter("fsr_drift.time_constant_s", 0.1, 1e3, "of the creep", 1.0, 10.0),
)
LAGGED = remember()


@inline
def force_reading(w, i, force, h):  # type: ignore[no-untyped-def]
    """A part of the reading follows the force late."""
    w[LAGGED, i] += (force - w[LAGGED, i]) * min(h / (w[TAU, i] + 0.5 * h), 1.0)
    return force + w[SHARE, i] * w[LAGGED, i]


EFFECT = Effect(
    "fsr_drift",
    "force_sensor",
    ("fsr_drift.share", "fsr_drift.time_constant_s"),
    ((0.2, 3.0), (0.2, 20.0), (-0.2, 10.0)),
    "under constant load the force reading creeps by {share} of itself with a time constant of {time_constant_s}",
    ("hold", "taps"),
    "Creep of the polymer of a force sensing resistor.",
    "one retardation term, Eq. 9, Martin et al. 2004",
    {"force_reading": force_reading},
    {"fsr_drift.time_constant_s": 1.0},
    shape=("fsr_drift.time_constant_s",),
)
