"""The valve answers a reversal of its set-point only after some way."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline, remember
from hand_model.plant_parameters import Parameter

(WIDTH,) = declare(Parameter("valve_hysteresis.width_pa", 0.0, 2e5, "half the gap of the play", 1.0, 0.0, 5e3))
PLAY = remember()


@inline
def set_point(w, i, u, p, e, h):  # type: ignore[no-untyped-def]
    """Play operator on the set-point."""
    w[PLAY, i] = min(max(w[PLAY, i], u - w[WIDTH, i]), u + w[WIDTH, i])
    return w[PLAY, i]


EFFECT = Effect(
    "valve_hysteresis",
    "valve",
    ("valve_hysteresis.width_pa",),
    ((3e3,), (1.5e4,)),
    "after each reversal of the set-point the valve stays behind by {width_pa} Pa on either side",
    ("slow_triangle", "reversals"),
    "Magnetic or frictional hysteresis of a proportional pressure valve, as play on its set-point.",
    "play operator, Visintin, Differential Models of Hysteresis, 1994",
    {"set_point": set_point},
    starts=((PLAY, "pressure"),),
)
