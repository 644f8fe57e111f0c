"""The pressure in the actuator follows the measured one late."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline, remember
from hand_model.plant_parameters import Parameter

(TAU,) = declare(Parameter("tube_lag.time_constant_s", 0.0, 1.0, "from the sensor to the actuator", 1.0, 0.0, 0.03))
LAGGED = remember()


@inline
def actuator_pressure(w, i, p, h):  # type: ignore[no-untyped-def]
    """First-order lag of the tube; its memory begins at the first pressure (chain.py)."""
    w[LAGGED, i] += (p - w[LAGGED, i]) * min(h / (w[TAU, i] + 0.5 * h), 1.0)
    return w[LAGGED, i]


EFFECT = Effect(
    "tube_lag",
    "fluid",
    ("tube_lag.time_constant_s",),
    ((0.02,), (0.08,)),
    "the actuator follows the measured pressure with a lag of {time_constant_s} s",
    ("steps", "multisine"),
    "Laminar resistance of the tube with the capacity of the actuator.",
    "Beater, Pneumatic Drives, 2007, tubes",
    {"actuator_pressure": actuator_pressure},
    starts=((LAGGED, "pressure"),),
)
