"""The angle reading is late."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline, remember
from hand_model.plant_parameters import Parameter

TAU, SECOND = declare(
    Parameter("angle_lag.time_constant_s", 0.0, 0.5, "of the filters together", 1.0, 0.0, 0.01),
    Parameter("angle_lag.second", 0.0, 0.5, "share of a second filter in it", 1.0, 0.0, 0.3),
)
FIRST = remember()
LAGGED = remember()


@inline
def angle_reading(w, i, phi, h):  # type: ignore[no-untyped-def]
    """One first-order filter or two; their memory begins at the first angle (chain.py)."""
    second = w[SECOND, i] * w[TAU, i]
    w[FIRST, i] += (phi - w[FIRST, i]) * min(h / (w[TAU, i] - second + 0.5 * h), 1.0)
    w[LAGGED, i] += (w[FIRST, i] - w[LAGGED, i]) * min(h / (second + 0.5 * h), 1.0)
    return w[LAGGED, i]


EFFECT = Effect(
    "angle_lag",
    "angle_sensor",
    ("angle_lag.time_constant_s", "angle_lag.second"),
    ((0.01, 0.0), (0.04, 0.0), (0.04, 0.5)),
    "the angle reading lags by {time_constant_s} s",
    ("steps", "multisine"),
    "Low-pass filter between the joint and its reading, of first or second order.",
    "first-order filters in series",
    {"angle_reading": angle_reading},
    starts=((FIRST, "angle"), (LAGGED, "angle")),
)
