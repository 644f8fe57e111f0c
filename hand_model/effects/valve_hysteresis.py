"""The valve answers a reversal of its set-point only after some way."""

from __future__ import annotations

import math

from hand_model.effects.effect import Effect, declare, inline, remember
from hand_model.plant_parameters import Parameter

WIDTH, SOFTNESS = declare(
    Parameter("valve_hysteresis.width_pa", 0.0, 2e5, "half the width of the loop", 1.0, 0.0, 5e3),
    Parameter("valve_hysteresis.softness", 0.0, 1.0, "0 a play, 1 a rounded loop", 1.0, 0.0, 0.17),
)
BEHIND = remember()
LAST = remember()


@inline
def set_point(w, i, u, p, e, h):  # type: ignore[no-untyped-def]
    """The set-point acts late by BEHIND, which grows with its way: as far as the gap, or towards it (Dahl)."""
    way, behind, width = u - w[LAST, i], w[BEHIND, i], w[WIDTH, i]
    slower = w[SOFTNESS, i] * min(max(math.copysign(1.0, way) * behind / (width + 1e-3), 0.0), 1.0)
    w[BEHIND, i], w[LAST, i] = min(max(behind + way * (1.0 - slower), -width), width), u
    return u - w[BEHIND, i]


EFFECT = Effect(
    "valve_hysteresis",
    "valve",
    ("valve_hysteresis.width_pa", "valve_hysteresis.softness"),
    ((3e3, 0.0), (1.5e4, 0.0), (3e3, 1.0), (1.5e4, 1.0)),
    "after each reversal of the set-point the valve stays behind by {width_pa} on either side",
    ("slow_triangle", "reversals"),
    "Magnetic or frictional hysteresis of a proportional pressure valve on its set-point.",
    "play operator, Visintin, Differential Models of Hysteresis, 1994; rounded as Dahl, Aerospace Corp. TOR-158, 1968",
    {"set_point": set_point},
    starts=((LAST, "pressure"),),
    shape=("valve_hysteresis.softness",),
)
