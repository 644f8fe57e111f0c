"""The angle reading is late."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, followed, inline, remember
from hand_model.plant_parameters import Parameter

TAU, SECOND = declare(
    Parameter("angle_lag.time_constant_s", 0.0, 0.5, "of the filters together", 1.0, 0.0, 0.01),
    Parameter("angle_lag.second", 0.0, 0.5, "share of a second filter in it", 1.0, 0.0, 0.1),
)
BEFORE, FIRST, LAGGED = remember(), remember(), remember()


@inline
def angle_reading(w, i, phi, h):  # type: ignore[no-untyped-def]
    """One first-order filter or two; their memory begins at the first angle (chain.py)."""
    second = w[SECOND, i] * w[TAU, i]
    first = followed(w[FIRST, i], w[BEFORE, i], phi, w[TAU, i] - second, h)
    w[LAGGED, i] = followed(w[LAGGED, i], w[FIRST, i], first, second, h)
    w[BEFORE, i], w[FIRST, i] = phi, first
    return w[LAGGED, i]


EFFECT = Effect(
    "angle_lag",
    "angle_sensor",
    ("angle_lag.time_constant_s", "angle_lag.second"),
    ((0.01, 0.25), (0.04, 0.25)),
    "the angle reading lags by {time_constant_s} s",
    ("steps", "multisine"),
    "Low-pass filter between the joint and its reading, of first or second order.",
    "first-order filters in series",
    {"angle_reading": angle_reading},
    starts=((BEFORE, "angle"), (FIRST, "angle"), (LAGGED, "angle")),
    shape=("angle_lag.second",),
)
