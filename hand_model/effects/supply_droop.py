"""The supply sags: it delivers less than its nominal pressure, and less again while joints fill."""

from __future__ import annotations

from hand_model.effects.effect import INFLOW, Effect, declare, inline, remember
from hand_model.plant_parameters import PLANT_ROW, Parameter

DEFICIT, RESISTANCE, TAU, SHARE, RATIO = declare(
    Parameter("supply_droop.deficit_pa", 0.0, 5e5, "supply pressure missing at rest", 1.0, 0.0, 5e4),
    Parameter("supply_droop.resistance_s", 0.0, 2.0, "sag per sum of all pressure rises", 1.0, 0.0, 0.05),
    Parameter("supply_droop.time_constant_s", 5e-3, 5.0, "in which the supply sags and recovers", 1.0, 0.1),
    Parameter("supply_droop.share", 0.0, 1.0, "of the sag that the pressure valves pass on", 1.0, 0.0, 0.3),
    Parameter("supply_droop.ratio", 0.0, 2.0, "of set-point over supply that they pass on, too", 1.0, 0.0, 0.3),
)
SAG = remember()
_SUPPLY = PLANT_ROW["supply.pressure_pa"]


@inline
def set_point(w, i, u, p, e, h):  # type: ignore[no-untyped-def]
    """No valve delivers more than the supply has; a regulator passes a part of the sag on, a throttle its ratio."""
    growth = (w[RESISTANCE, i] * e[INFLOW] - w[SAG, i]) * (h / (w[TAU, i] + 0.5 * h))
    sag = w[SAG, i] + 0.5 * growth  # amid the step, for which the set-point holds
    w[SAG, i] += growth
    passed = (w[SHARE, i] + w[RATIO, i] * u / w[_SUPPLY, i]) * sag
    return max(min(u - passed, w[_SUPPLY, i] - w[DEFICIT, i] - sag), 0.0)


EFFECT = Effect(
    "supply_droop",
    "supply",
    (
        "supply_droop.deficit_pa",
        "supply_droop.resistance_s",
        "supply_droop.time_constant_s",
        "supply_droop.share",
        "supply_droop.ratio",
    ),
    (
        (5e4, 0.0, 0.1, 0.0, 0.0),
        (2e5, 0.0, 0.1, 0.0, 0.0),
        (0.0, 0.1, 0.05, 0.0, 0.0),
        (0.0, 0.05, 0.05, 0.7, 0.0),
        (0.0, 0.05, 0.3, 0.0, 0.7),
    ),
    "the supply pressure is {deficit_pa} too low at rest and falls by {resistance_s} times the total rate of filling",
    ("steps", "staircase"),
    "Supply pressure falls with the flow drawn; no set-point above it is reached.",
    "resistance and capacity of a supply line, Beater, Pneumatic Drives, 2007",
    {"set_point": set_point},
    {"supply_droop.time_constant_s": 1.0},
    shape=("supply_droop.time_constant_s",),
)
