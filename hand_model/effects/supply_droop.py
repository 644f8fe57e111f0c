"""The supply sags: it delivers less than its nominal pressure, and less again while joints fill."""

from __future__ import annotations

from hand_model.effects.effect import INFLOW, Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Share of a change of the sag that happens within a step, and the ratio per set-point [1/Pa]."""
    tau, ratio, supply = q[2], q[4], q[5]
    return h / (tau + 0.5 * h), ratio / supply


@inline
def set_point(q, m, u, p, e, h):  # type: ignore[no-untyped-def]
    """No valve delivers more than the supply has; a regulator passes a part of the sag on, a throttle its ratio."""
    deficit, resistance, share, supply, approach, ratio_per_pa = q[0], q[1], q[3], q[5], q[6], q[7]
    (before,) = m
    growth = (resistance * e[INFLOW] - before) * approach
    sag = before + 0.5 * growth  # in the middle of the step, for which the set-point holds
    passed = (share + ratio_per_pa * u) * sag
    return max(min(u - passed, supply - deficit - sag), 0.0), (before + growth,)


EFFECT = Effect(
    name="supply_droop",
    place="supply",
    parameters=(
        Parameter("supply_droop.deficit_pa", 0.0, 5e5, "supply pressure missing at rest", 1.0, 0.0, 5e4),
        Parameter("supply_droop.resistance_s", 0.0, 2.0, "sag per sum of all pressure rises", 1.0, 0.0, 0.05),
        Parameter("supply_droop.time_constant_s", 5e-3, 5.0, "in which the supply sags and recovers", 1.0, 0.1),
        Parameter("supply_droop.share", 0.0, 1.0, "of the sag that the pressure valves pass on", 1.0, 0.0, 0.3),
        Parameter("supply_droop.ratio", 0.0, 2.0, "of set-point over supply that they pass on, too", 1.0, 0.0, 0.3),
    ),
    reads=("supply.pressure_pa",),
    prepared=("approach", "ratio_per_pa"),
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
    ),
    spread={"supply_droop.time_constant_s": 1.0},
    shape=("supply_droop.time_constant_s",),
    says="the supply pressure is {deficit_pa} too low at rest and falls by {resistance_s} times the total"
    " rate of filling",
    experiments=("steps", "staircase"),
    doc="Supply pressure falls with the flow drawn; no set-point above it is reached.",
    source="resistance and capacity of a supply line, Beater, Pneumatic Drives, 2007",
    meets_others=True,
)
