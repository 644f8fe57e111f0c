"""Topics are stamped by clocks that differ."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare
from hand_model.plant_parameters import Parameter

OFFSET, SHARE = declare(
    Parameter("clock_offset.offset_s", -0.2, 0.2, "stamp of pressures minus that of angles", 1.0, 0.0, 0.01),
    Parameter(
        "clock_offset.share",
        0.0,
        1.0,
        "of it against the set-points: 1 where they share the angles' clock",
        1.0,
        1.0,
        0.17,
    ),
)

EFFECT = Effect(
    "clock_offset",
    "timing",
    ("clock_offset.offset_s", "clock_offset.share"),
    ((0.01, 1.0), (-0.01, 1.0), (0.03, 1.0), (-0.03, 1.0), (0.03, 0.0), (-0.03, 0.0)),
    "the time stamps of the {pressure} are {offset_s} late against those of the {angle}, and {share} of that against"
    " those of the set-points",
    ("steps", "multisine"),
    "A constant difference between the clocks of two topics, the same at every joint.",
    "definition",
    everywhere=True,
    shape=("clock_offset.share",),
)
