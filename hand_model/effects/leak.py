"""The actuator or its tube loses air."""

from __future__ import annotations

import math

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter

BAR_PA = 1e5


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Reciprocal of the supply pressure."""
    return (1.0 / q[4],)


@inline
def pressure_source(q, p, e):  # type: ignore[no-untyped-def]
    """Laminar or turbulent loss. The valve feeds against it, so the pressure stays below its set-point.

    The law lets the conductance grow with the pressure, as a gas becomes denser and a gap opens, and lets a crack or a
    seal open at a pressure, whose excess is lost.
    """
    lost, turbulent, growth, opens, _, per_supply = q
    excess = p - min(opens, max(p, 0.0))
    loss = -lost * ((1.0 - turbulent) * excess + turbulent * math.sqrt(BAR_PA * max(excess, 0.0)))
    return loss * (1.0 + growth * min(max(p * per_supply, 0.0), 1.0))


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Loss [Pa/s] at the pressure x [Pa]."""
    return -float(pressure_source(q, x, ()))


EFFECT = Effect(
    name="leak",
    place="fluid",
    needs=("chamber",),
    parameters=(
        Parameter("leak.rate_per_s", 0.0, 50.0, "share of the pressure lost in a second, at 1 bar", 1.0, 0.0, 0.1),
        Parameter("leak.turbulent", 0.0, 1.0, "0 a gap, loss with pressure; 1 a hole, with its root", 1.0, 0.0, 0.17),
        Parameter("leak.with_pressure", 0.0, 20.0, "law: growth up to supply pressure", 1.0, 0.0, 0.5, law=True),
        Parameter("leak.opens_pa", 0.0, 5e5, "law: pressure at which it opens", 1.0, 0.0, 3e4, law=True),
    ),
    reads=("supply.pressure_pa",),
    prepared=("per_supply",),
    hooks={"prepare": prepare, "pressure_source": pressure_source},
    keys=("leak.rate_per_s", "leak.turbulent"),
    probes=((0.2, 0.0), (1.0, 0.0), (0.2, 1.0), (1.0, 1.0)),
    shape=("leak.turbulent",),
    says="the actuator leaks with a rate of {rate_per_s} at 1 bar (turbulent share {turbulent})",
    experiments=("closed_valve_push", "hold"),
    doc="Leakage to the room: through a gap proportional to gauge pressure, through a hole to its root.",
    source="ideal gas at constant temperature through a laminar gap or an orifice, Beater, Pneumatic Drives, 2007",
    constitution=Constitution(
        acts_on="rate of the pressure",
        sign="towards the pressure of the room",
        passive=True,
        monotone="rises with the pressure, from the one at which it opens, and is 0 at that of the room",
        over=("pressure",),
        coefficients=("leak.with_pressure", "leak.opens_pa"),
        needs={"leak.opens_pa": "valve"},  # a closed volume that only empties does not separate it from the rate
        quantity="the loss",
        unit="pa_per_s",
        curve=curve,
        source="flow from high to low pressure only; Beater, Pneumatic Drives, 2007, ch. 2",
    ),
)
