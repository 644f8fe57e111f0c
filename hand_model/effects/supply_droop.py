"""The supply sags: it delivers less than its nominal pressure, and less again while joints fill."""

from __future__ import annotations

from hand_model.effects.effect import INFLOW, Effect, declare, inline, remember
from hand_model.plant_parameters import PLANT_ROW, Parameter

DEFICIT, RESISTANCE, SHARE = declare(
    Parameter("supply_droop.deficit_pa", 0.0, 5e5, "supply pressure missing at rest", 1.0, 0.0, 5e4),
    Parameter("supply_droop.resistance_s", 0.0, 2.0, "sag per sum of all pressure rises", 1.0, 0.0, 0.05),
    Parameter("supply_droop.share", 0.0, 1.0, "of the sag that the pressure valves pass on", 1.0, 0.0, 0.3),
)
SAG = remember()
TIME_S = 0.05
_SUPPLY = PLANT_ROW["supply.pressure_pa"]


@inline
def set_point(w, i, u, p, e, h):  # type: ignore[no-untyped-def]
    """No valve delivers more than the supply has, and a regulator passes a part of the sag on."""
    w[SAG, i] += (w[RESISTANCE, i] * e[INFLOW] - w[SAG, i]) * (h / (TIME_S + h))
    return max(min(u - w[SHARE, i] * w[SAG, i], w[_SUPPLY, i] - w[DEFICIT, i] - w[SAG, i]), 0.0)


EFFECT = Effect(
    "supply_droop",
    "supply",
    ("supply_droop.deficit_pa", "supply_droop.resistance_s", "supply_droop.share"),
    ((5e4, 0.0, 0.0), (2e5, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.05, 0.7)),
    "the supply lacks {deficit_pa} Pa at rest and sags by {resistance_s} Pa per Pa/s that the joints fill",
    ("steps", "staircase"),
    "Supply pressure falls with the flow drawn; no set-point above it is reached.",
    "resistance and capacity of a supply line, Beater, Pneumatic Drives, 2007",
    {"set_point": set_point},
)
