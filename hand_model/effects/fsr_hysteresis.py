"""The force reading depends on whether the load rises or falls."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline, remember
from hand_model.plant_parameters import Parameter

SHARE, TURN = declare(
    Parameter("fsr_hysteresis.share", 0.0, 0.9, "half the loop over the force", 1.0, 0.0, 0.1),
    Parameter("fsr_hysteresis.turn_n", 0.02, 50.0, "change of force that turns the loop half around", 1.0, 0.5),
)
TURNED = remember()
LAST = remember()


@inline
def force_reading(w, i, force, h):  # type: ignore[no-untyped-def]
    """The reading stays behind by a share of the force; a stop operator says on which side."""
    turned = w[TURNED, i] + (force - w[LAST, i]) / w[TURN, i]
    w[TURNED, i], w[LAST, i] = min(max(turned, -1.0), 1.0), force
    return force * (1.0 - w[SHARE, i] * w[TURNED, i])


EFFECT = Effect(
    "fsr_hysteresis",
    "force_sensor",
    ("fsr_hysteresis.share", "fsr_hysteresis.turn_n"),
    ((0.1, 0.5), (0.3, 0.5), (0.1, 3.0)),
    "the force reading has a loop of {share} of the force on either side, crossed within {turn_n}",
    ("taps", "slow_triangle"),
    "Loading and unloading curves of a force sensing resistor differ.",
    "stop operator, Visintin, Differential Models of Hysteresis, 1994",
    {"force_reading": force_reading},
    {"fsr_hysteresis.turn_n": 1.5},
    shape=("fsr_hysteresis.turn_n",),
)
