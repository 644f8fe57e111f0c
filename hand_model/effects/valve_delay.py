"""The valve begins to answer later than its model."""

from __future__ import annotations

from hand_model.effects.effect import Effect

EFFECT = Effect(
    "valve_delay",
    "valve",
    ("valve.dead_time_s",),
    ((0.015,), (0.03,), (0.0,)),
    "the valve reacts after a dead time of {dead_time_s}",
    ("steps", "multisine"),
    "Dead time between a set-point and the first change of pressure.",
    "Martin et al. 2004, Sec. 3.3",
)
