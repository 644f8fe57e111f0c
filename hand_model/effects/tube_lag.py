"""The pressure in the actuator follows the measured one late."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, followed_twice, inline, remember
from hand_model.plant_parameters import Parameter

TAU, SECOND = declare(
    Parameter("tube_lag.time_constant_s", 0.0, 1.0, "from the sensor to the actuator", 1.0, 0.0, 0.03),
    Parameter("tube_lag.second", 0.0, 0.5, "share of a second volume in it", 1.0, 0.0, 0.1),
)
ROWS = (remember(), remember(), remember())


@inline
def actuator_pressure(w, i, p, h):  # type: ignore[no-untyped-def]
    """A line of one volume or two; their memory begins at the first pressure (chain.py)."""
    return followed_twice(w, i, ROWS, p, w[TAU, i], w[SECOND, i], h)


EFFECT = Effect(
    "tube_lag",
    "fluid",
    ("tube_lag.time_constant_s", "tube_lag.second"),
    ((0.02, 0.25), (0.08, 0.25)),
    "the {pressure} in the actuator lags the measured {pressure} by {time_constant_s}",
    ("steps", "multisine"),
    "Laminar resistance of the tube with the capacity of the actuator, as one volume or two.",
    "Beater, Pneumatic Drives, 2007, tubes",
    {"actuator_pressure": actuator_pressure},
    starts=tuple((row, "pressure") for row in ROWS),
    shape=("tube_lag.second",),
)
