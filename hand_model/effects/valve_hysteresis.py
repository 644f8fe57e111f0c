"""The valve answers a reversal of its set-point only after the set-point has moved by the width of a loop."""

from __future__ import annotations

import math

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.effects.operators import decay
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter

LEAST_PA = 1e-3
LEAST_SOFTNESS = 1e-6
"""Keep the way of a loop positive, and finite."""
SECOND = 1.0 / 3.0
"""Width of each further play of the law over that of the one before."""


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Way [Pa] over which a rounded loop closes to 1/e, and its reciprocal."""
    reach = (q[0] + LEAST_PA) / max(q[1], LEAST_SOFTNESS)
    return reach, 1.0 / reach


@inline
def set_point(q, m, u, p, e, h):  # type: ignore[no-untyped-def]
    """The valve lags by `behind`, which grows with the motion of u up to the width: at once, or gradually (Dahl).

    Both are exact for any motion, which may come at once or in parts. By the law, it follows a share of a reversal at
    once, and plays of a third and a ninth of the width take their shares of the loop (Prandtl and Ishlinskii).
    """
    width, soft, follows, inner, innermost, reach, per_reach = q
    behind, last, second, third = m
    way = u - last
    toward = math.copysign(1.0, way)
    along, far = max(toward * behind, -width), abs(way)
    straight = min(far, max(-along, 0.0)) if soft > 0.0 else far
    along += straight
    along += (reach - along) * (1.0 - decay((far - straight) * per_reach))
    behind = toward * min(along, width)
    second = min(max(second + way, -width * SECOND), width * SECOND)
    third = min(max(third + way, -width * SECOND * SECOND), width * SECOND * SECOND)
    plays = (1.0 - innermost) * ((1.0 - inner) * behind + inner * second) + innermost * third
    return u - (1.0 - follows) * plays, (behind, u, second, third)


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """How far the valve is behind [Pa] after the motion x [Pa] since a reversal of a wide loop; 0 at its middle."""
    width, soft, follows, inner, innermost, reach, per_reach = q
    beyond = max(x - width, 0.0)
    grown = reach * -math.expm1(-beyond * per_reach) if soft > 0.0 else beyond
    outer = min(x, width) - width + min(grown, width)
    second, third = (min(x, 2.0 * r) - r for r in (width * SECOND, width * SECOND * SECOND))
    wider = (1.0 - inner) * outer + inner * second
    return float((1.0 - follows) * ((1.0 - innermost) * wider + innermost * third))


_LAW = tuple(
    Parameter(f"valve_hysteresis.{name}", 0.0, most, f"law: {doc}", 1.0, 0.0, 0.3, law=True)
    for name, most, doc in (
        ("follows", 0.95, "share of a reversal that the valve follows at once"),
        ("inner", 1.0, "share of the play of a third of the width in the two wider ones"),
        ("innermost", 1.0, "share of the play of a ninth of the width"),
    )
)
EFFECT = Effect(
    name="valve_hysteresis",
    place="valve",
    needs=("valve",),
    parameters=(
        Parameter("valve_hysteresis.width_pa", 0.0, 2e5, "half the width of the loop", 1.0, 0.0, 5e3),
        Parameter("valve_hysteresis.softness", 0.0, 1.0, "0 a play, 1 a rounded loop", 1.0, 0.0, 0.17),
        *_LAW,
    ),
    prepared=("reach", "per_reach"),
    memory={"behind": 0.0, "last": "pressure", "second": 0.0, "third": 0.0},
    law_memory=("second", "third"),
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
        memory="states that change with the set-point only",
        over=("set-point",),
        coefficients=tuple(parameter.key for parameter in _LAW),
        quantity="the way that the valve stays behind",
        unit="pa",
        curve=curve,
        source="Visintin, Differential Models of Hysteresis, 1994, ch. III: play operator, and sums of plays with"
        " weights that are not negative (Prandtl and Ishlinskii)",
    ),
)
