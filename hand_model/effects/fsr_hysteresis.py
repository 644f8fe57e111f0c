"""The force reading depends on whether the load rises or falls."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline, remember
from hand_model.plant_parameters import Parameter

(SHARE,) = declare(Parameter("fsr_hysteresis.share", 0.0, 0.9, "half the loop over the force", 1.0, 0.0, 0.1))
PLAY = remember()


@inline
def force_reading(w, i, force, h):  # type: ignore[no-untyped-def]
    """Play whose gap grows with the force."""
    w[PLAY, i] = min(max(w[PLAY, i], force * (1.0 - w[SHARE, i])), force * (1.0 + w[SHARE, i]))
    return w[PLAY, i]


EFFECT = Effect(
    "fsr_hysteresis",
    "force_sensor",
    ("fsr_hysteresis.share",),
    ((0.1,), (0.3,)),
    "the force reading has a loop of {share} of the force on either side",
    ("taps", "slow_triangle"),
    "Loading and unloading curves of a force sensing resistor differ.",
    "play operator, Visintin, Differential Models of Hysteresis, 1994",
    {"force_reading": force_reading},
)
