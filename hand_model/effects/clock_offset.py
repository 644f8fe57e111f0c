"""Topics are stamped by clocks that differ."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare
from hand_model.plant_parameters import Parameter

(OFFSET,) = declare(
    Parameter("clock_offset.offset_s", -0.2, 0.2, "stamp of pressures minus that of angles", 1.0, 0.0, 0.01)
)

EFFECT = Effect(
    "clock_offset",
    "timing",
    ("clock_offset.offset_s",),
    ((0.01,), (-0.01,), (0.03,), (-0.03,)),
    "the pressure stamps are {offset_s} s late against those of the angles",
    ("steps", "multisine"),
    "A constant difference between the clocks of two topics, the same at every joint.",
    "definition",
    everywhere=True,
)
