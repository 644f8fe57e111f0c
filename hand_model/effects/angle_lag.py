"""The angle reading is late."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, followed_twice, inline, remember
from hand_model.plant_parameters import Parameter

TAU, SECOND = declare(
    Parameter("angle_lag.time_constant_s", 0.0, 0.5, "of the filters together", 1.0, 0.0, 0.01),
    Parameter("angle_lag.second", 0.0, 0.5, "share of a second filter in it", 1.0, 0.0, 0.1),
)
ROWS = (remember(), remember(), remember())


@inline
def angle_reading(w, i, phi, h):  # type: ignore[no-untyped-def]
    """One first-order filter or two; their memory begins at the first angle (chain.py)."""
    return followed_twice(w, i, ROWS, phi, w[TAU, i], w[SECOND, i], h)


EFFECT = Effect(
    "angle_lag",
    "angle_sensor",
    ("angle_lag.time_constant_s", "angle_lag.second"),
    ((0.01, 0.25), (0.04, 0.25)),
    "the {angle} reading lags by {time_constant_s}",
    ("steps", "multisine"),
    "Low-pass filter between the joint and its reading, of first or second order.",
    "first-order filters in series",
    {"angle_reading": angle_reading},
    starts=tuple((row, "angle") for row in ROWS),
    shape=("angle_lag.second",),
)
