"""The actuator or its tube loses air."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline
from hand_model.plant_parameters import Parameter

(RATE,) = declare(Parameter("leak.rate_per_s", 0.0, 50.0, "share of the pressure lost in a second", 1.0, 0.0, 0.5))


@inline
def pressure_rate(w, i, rate, p, u, e):  # type: ignore[no-untyped-def]
    """Laminar loss; the valve tops it up, so pressure stays below its set-point."""
    return rate - w[RATE, i] * p


EFFECT = Effect(
    "leak",
    "fluid",
    ("leak.rate_per_s",),
    ((0.3,), (2.0,)),
    "the actuator loses {rate_per_s} of its pressure a second",
    ("closed_valve_push", "hold"),
    "Laminar leakage to the room, proportional to gauge pressure.",
    "ideal gas at constant temperature through a laminar gap, Beater, Pneumatic Drives, 2007",
    {"pressure_rate": pressure_rate},
)
