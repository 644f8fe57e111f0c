"""The valve passes only so much: filling and venting have their own limits, choked or not."""

from __future__ import annotations

from hand_model.effects.effect import ATMOSPHERE_PA, Effect, Times, declare, inline
from hand_model.plant_parameters import PLANT_ROW, Parameter
from hand_model.pressure_loop import subsonic

(CHOKING,) = declare(
    Parameter("valve_flow_limit.choking", 0.0, 1.0, "0 a constant limit, 1 a choked one", 1.0, 0.0, 0.17)
)
_SUPPLY = PLANT_ROW["supply.pressure_pa"]
_FILL = PLANT_ROW["valve.fill_rate_pa_per_s"]
_VENT = PLANT_ROW["valve.vent_rate_pa_per_s"]
CRITICAL = 0.3
"""Critical pressure ratio of a small valve."""
_PER_SPAN = 1.0 / (1.0 - CRITICAL)


@inline
def pressure_rate(w, i, rate, p, u, e):  # type: ignore[no-untyped-def]
    """Limits that follow the pressures on both sides of the valve."""
    full, here, c = w[_SUPPLY, i] + ATMOSPHERE_PA, p + ATMOSPHERE_PA, w[CHOKING, i]
    fill = w[_FILL, i] * (1.0 - c + c * subsonic(here / full, CRITICAL, _PER_SPAN))
    vent = w[_VENT, i] * (1.0 - c + c * subsonic(ATMOSPHERE_PA / max(here, 1.0), CRITICAL, _PER_SPAN) * here / full)
    return min(max(rate, -vent), fill)


EFFECT = Effect(
    "valve_flow_limit",
    "valve",
    ("valve.fill_rate_pa_per_s", "valve.vent_rate_pa_per_s", "valve_flow_limit.choking"),
    (
        (Times(0.1), Times(0.1), 0.0),
        (Times(0.1), Times(0.4), 0.0),
        (Times(0.4), Times(0.1), 0.0),
        (Times(0.2), Times(0.3), 0.8),
        (Times(0.04), Times(0.04), 0.0),
        (Times(0.06), Times(0.06), 1.0),
    ),
    "the valve fills at most {fill_rate_pa_per_s} and vents at most {vent_rate_pa_per_s}",
    ("steps", "chirp"),
    "Sonic conductance bounds the flow; filling from the supply and venting to the room differ.",
    "ISO 6358-1:2013, flow characteristics of pneumatic components",
    {"pressure_rate": pressure_rate},
    {"valve.fill_rate_pa_per_s": 2.0, "valve.vent_rate_pa_per_s": 2.0},
    shape=("valve.fill_rate_pa_per_s", "valve.vent_rate_pa_per_s"),
)
