"""The actuator or its tube loses air."""

from __future__ import annotations

import math

from hand_model.effects.effect import Effect, declare, inline
from hand_model.plant_parameters import Parameter

RATE, TURBULENT = declare(
    Parameter("leak.rate_per_s", 0.0, 50.0, "share of the pressure lost in a second, at 1 bar", 1.0, 0.0, 0.1),
    Parameter("leak.turbulent", 0.0, 1.0, "0 a gap, loss with pressure; 1 a hole, with its root", 1.0, 0.0, 0.17),
)
BAR_PA = 1e5


@inline
def pressure_rate(w, i, rate, p, u, e):  # type: ignore[no-untyped-def]
    """Laminar or turbulent loss; the valve tops it up, so pressure stays below its set-point."""
    turbulent = w[TURBULENT, i]
    return rate - w[RATE, i] * ((1.0 - turbulent) * p + turbulent * math.sqrt(BAR_PA * max(p, 0.0)))


EFFECT = Effect(
    "leak",
    "fluid",
    ("leak.rate_per_s", "leak.turbulent"),
    ((0.2, 0.0), (1.0, 0.0), (0.2, 1.0), (1.0, 1.0)),
    "the actuator leaks with a rate of {rate_per_s} at 1 bar (turbulent share {turbulent})",
    ("closed_valve_push", "hold"),
    "Leakage to the room: through a gap proportional to gauge pressure, through a hole to its root.",
    "ideal gas at constant temperature through a laminar gap or an orifice, Beater, Pneumatic Drives, 2007",
    {"pressure_rate": pressure_rate},
    shape=("leak.turbulent",),
)
