"""A hydraulic fluid instead of air: volume is what the valve feeds, whatever the pressure, Eq. 7's second case.

It is no mismatch to be searched for but the choice `fluid: hydraulic` of the description.
"""

from __future__ import annotations

from hand_model.effects.effect import ANGLE, SPEED, Effect, declare, inline
from hand_model.plant_parameters import PLANT_ROW, Parameter

ON, GROWTH = declare(
    Parameter("hydraulic.share", 0.0, 1.0, "1: an incompressible fluid, Eq. 7; set by `fluid`", 1.0, 0.0, 1.0),
    Parameter("hydraulic.volume_m3_per_pa", 1e-14, 1e-9, "growth of the chamber with pressure", 1.0, 1.2e-12),
)
_A2, _A3 = PLANT_ROW["statics.a2_nm_per_pa"], PLANT_ROW["statics.a3_nm_per_pa_rad"]


@inline
def pressure_rate(w, i, rate, p, u, e):  # type: ignore[no-untyped-def]
    """Volume c_V p + (a2 + a3 phi / 2) phi changes by what is fed alone: motion moves the pressure at once."""
    displaced = (w[_A2, i] + w[_A3, i] * e[ANGLE]) * e[SPEED]
    return rate - w[ON, i] * displaced / w[GROWTH, i]


EFFECT = Effect(
    "hydraulic",
    "fluid",
    (),
    (),
    "the fluid is a liquid",
    (),
    "Constant volume of an incompressible fluid in an elastic chamber.",
    "Eq. 7, Martin et al. 2004, with the volume map tied to Eq. 6 by virtual work",
    {"pressure_rate": pressure_rate},
)
