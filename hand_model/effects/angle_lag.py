"""The angle reading is late."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline, remember
from hand_model.plant_parameters import Parameter

(TAU,) = declare(Parameter("angle_lag.time_constant_s", 0.0, 0.5, "filter of the reading", 1.0, 0.0, 0.01))
LAGGED = remember()


@inline
def angle_reading(w, i, phi, h):  # type: ignore[no-untyped-def]
    """First-order filter; its memory begins at the first angle (chain.py)."""
    w[LAGGED, i] += (phi - w[LAGGED, i]) * min(h / (w[TAU, i] + 0.5 * h), 1.0)
    return w[LAGGED, i]


EFFECT = Effect(
    "angle_lag",
    "angle_sensor",
    ("angle_lag.time_constant_s",),
    ((0.01,), (0.04,)),
    "the angle reading lags by {time_constant_s} s",
    ("steps", "multisine"),
    "Low-pass filter between the joint and its reading.",
    "first-order filter",
    {"angle_reading": angle_reading},
    starts=((LAGGED, "angle"),),
)
