"""The valve answers a reversal of its set-point only after the set-point has moved by the width of a loop."""

from __future__ import annotations

import math

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter

LEAST_PA = 1e-3
"""Keeps the reciprocal of the width finite."""


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Reciprocal of half the width of the loop."""
    return (1.0 / (q[0] + LEAST_PA),)


@inline
def set_point(q, m, u, p, e, h):  # type: ignore[no-untyped-def]
    """The valve lags by `behind`, which grows with the motion of u up to the width: at once, or gradually (Dahl)."""
    width, soft, per_width = q
    behind, last = m
    way = u - last
    slower = soft * min(max(math.copysign(1.0, way) * behind * per_width, 0.0), 1.0)
    behind = min(max(behind + way * (1.0 - slower), -width), width)
    return u - behind, (behind, u)


EFFECT = Effect(
    name="valve_hysteresis",
    place="valve",
    needs=("valve",),
    parameters=(
        Parameter("valve_hysteresis.width_pa", 0.0, 2e5, "half the width of the loop", 1.0, 0.0, 5e3),
        Parameter("valve_hysteresis.softness", 0.0, 1.0, "0 a play, 1 a rounded loop", 1.0, 0.0, 0.17),
    ),
    prepared=("per_width",),
    memory={"behind": 0.0, "last": "pressure"},
    hooks={"prepare": prepare, "set_point": set_point},
    keys=("valve_hysteresis.width_pa", "valve_hysteresis.softness"),
    probes=((3e3, 0.0), (1.5e4, 0.0), (3e3, 1.0), (1.5e4, 1.0)),
    shape=("valve_hysteresis.softness",),
    says="after each reversal of the set-point the valve stays behind by {width_pa} on either side",
    experiments=("slow_triangle", "reversals"),
    doc="Magnetic or frictional hysteresis of a proportional pressure valve on its set-point.",
    source="play operator, Visintin, Differential Models of Hysteresis, 1994; rounded as Dahl, Aerospace Corp."
    " TOR-158, 1968",
    constitution=Constitution(
        acts_on="set-point that reaches the valve",
        sign="behind the motion of the set-point",
        passive=True,
        monotone="does not go back while the set-point goes on",
        memory="one state that changes with the set-point only",
        over=("set-point",),
        source="Visintin, Differential Models of Hysteresis, 1994, ch. III: play operator",
    ),
)
