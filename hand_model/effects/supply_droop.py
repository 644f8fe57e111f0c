"""The supply sags: it delivers less than its nominal pressure, and less again while joints fill."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import INFLOW, Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Share of a change of the sag that happens within a step, and the ratio per set-point [1/Pa]."""
    tau, ratio, recovery, supply = q[2], q[4], q[6], q[9]
    return h / (tau + 0.5 * h), ratio / supply, h / (tau * recovery + 0.5 * h), 1.0 / supply


@inline
def set_point(q, m, u, p, e, h):  # type: ignore[no-untyped-def]
    """No valve delivers more than the supply has; a regulator passes a part of what it lacks on, a throttle its ratio.

    By the law the resistance grows with the flow, the reservoir recovers at another rate than it sags, the flow that
    refills it does not exceed what the source gives, and valves fill more slowly the lower the supply is.
    """
    deficit, resistance, share, slowing, supply = q[0], q[1], q[3], q[8], q[9]
    approach, ratio_per_pa, recovering, per_supply = q[10:]
    (before,) = m
    refill = before / (1.0 + q[7] * (before * per_supply))
    change = resistance * e[INFLOW] * (1.0 + q[5] * (e[INFLOW] * per_supply)) - refill
    growth = max(change, 0.0) * approach + min(change, 0.0) * recovering
    sag = before + 0.5 * growth  # in the middle of the step, for which the set-point holds
    passed = (share + ratio_per_pa * u) * (deficit + sag)
    to = max(min(u - passed, supply - deficit - sag), 0.0)
    slower = slowing * min(max(sag * per_supply, 0.0), 1.0) * max(to - p, 0.0)
    return to - slower, (before + growth,)


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Sag [Pa] at the lasting inflow x [Pa/s] of the hand, at most the whole supply."""
    supply, per_supply = q[9], q[13]
    refill = q[1] * x * (1.0 + q[5] * x * per_supply)
    left = 1.0 - q[7] * (refill * per_supply)
    return float(min(q[0] + (refill / left if left > 0.0 else supply), supply))


EFFECT = Effect(
    name="supply_droop",
    place="supply",
    needs=("supply",),
    parameters=(
        Parameter("supply_droop.deficit_pa", 0.0, 5e5, "supply pressure missing at rest", 1.0, 0.0, 5e4),
        Parameter("supply_droop.resistance_s", 0.0, 20.0, "sag per sum of all pressure rises", 1.0, 0.0, 0.05),
        Parameter("supply_droop.time_constant_s", 5e-3, 200.0, "in which the supply sags and recovers", 1.0, 0.1),
        Parameter(
            "supply_droop.share",
            -0.5,
            1.0,
            "of what is missing that valves pass on; negative: they rise",
            1.0,
            0.0,
            0.3,
        ),
        Parameter("supply_droop.ratio", 0.0, 2.0, "of set-point over supply that they pass on, too", 1.0, 0.0, 0.3),
        Parameter(
            "supply_droop.turbulent", 0.0, 10.0, "law: growth at a supply pressure a second", 1.0, 0.0, 0.5, law=True
        ),
        Parameter(
            "supply_droop.recovery_ratio", 0.1, 10.0, "law: time of recovery over that of sag", 1.0, 1.0, 0.5, law=True
        ),
        Parameter(
            "supply_droop.limited", 0.0, 50.0, "law: supply over the sag of half the refill", 1.0, 0.0, 3.0, law=True
        ),
        Parameter("supply_droop.slowing", 0.0, 1.0, "law: of filling lost with the supply", 1.0, 0.0, 0.3, law=True),
    ),
    reads=("supply.pressure_pa",),
    prepared=("approach", "ratio_per_pa", "recovering", "per_supply"),
    memory=("sag",),
    hooks={"prepare": prepare, "set_point": set_point},
    keys=(
        "supply_droop.deficit_pa",
        "supply_droop.resistance_s",
        "supply_droop.time_constant_s",
        "supply_droop.share",
        "supply_droop.ratio",
    ),
    probes=(
        (5e4, 0.0, 0.1, 0.0, 0.0),
        (2e5, 0.0, 0.1, 0.0, 0.0),
        (0.0, 0.1, 0.05, 0.0, 0.0),
        (0.0, 0.05, 0.05, 0.7, 0.0),
        (0.0, 0.05, 0.3, 0.0, 0.7),
        (0.0, 1.0, 20.0, 0.0, 0.7),
        (0.0, 1.0, 5.0, 0.0, 0.0),
        (0.0, 0.1, 0.3, -0.1, 0.0),
    ),
    spread={"supply_droop.time_constant_s": 1.0},
    shape=("supply_droop.time_constant_s",),
    says="the supply pressure is {deficit_pa} too low at rest and falls by {resistance_s} times the total"
    " rate of filling",
    shared=(
        "supply_droop.deficit_pa",
        "supply_droop.resistance_s",
        "supply_droop.time_constant_s",
        "supply_droop.share",
        "supply_droop.ratio",
        "supply_droop.turbulent",
        "supply_droop.recovery_ratio",
        "supply_droop.limited",
        "supply_droop.slowing",
    ),
    experiments=("steps", "staircase"),
    doc="Supply pressure falls with the flow drawn; no set-point above it is reached.",
    source="resistance and capacity of a supply line, Beater, Pneumatic Drives, 2007; pressure regulation"
    " characteristics of regulators, ISO 6953-2",
    meets_others=True,
    draws=True,
    constitution=Constitution(
        acts_on="supply pressure of all valves",
        sign="below the nominal supply",
        passive=True,
        monotone="the sag rises with the flow drawn, at least in proportion",
        memory="one reservoir",
        over=("inflow",),
        coefficients=(
            "supply_droop.turbulent",
            "supply_droop.recovery_ratio",
            "supply_droop.limited",
            "supply_droop.slowing",
        ),
        quantity="the sag of the supply",
        unit="pa",
        curve=curve,
        source="Darcy-Weisbach, White, Fluid Mechanics, 2016, ch. 6: losses of a line rise at least in proportion to"
        " the flow; one capacity",
    ),
)
