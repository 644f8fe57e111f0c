"""Colours of joints by the mismatch of their model."""

from __future__ import annotations

import math

from hand_model.arrays import Array

NOISE, LARGE = 5.0, 500.0
"""Mismatches [standard deviations] up to which a joint keeps its colour, and from which it has the full tint."""
PLAIN, FULL = (196, 201, 208), (213, 94, 0)
"""From light grey to vermilion: different in brightness, too, for the colour blind (Okabe and Ito 2008)."""


def tint(mismatch: float) -> tuple[int, int, int]:
    """Colour of a mismatch [standard deviations]; its logarithm counts, because models of real hands are far off."""
    share = math.log(max(abs(mismatch), NOISE) / NOISE) / math.log(LARGE / NOISE)
    steps = round(8.0 * min(share, 1.0)) / 8.0  # a new colour is a message to every page
    red, green, blue = (round(a + steps * (b - a)) for a, b in zip(PLAIN, FULL, strict=True))
    return red, green, blue


def tints(mismatch: Array) -> dict[int, tuple[int, int, int]]:
    """Colours by the index of the joint. mismatch: (joints,) [standard deviations]."""
    return {joint: tint(float(value)) for joint, value in enumerate(mismatch)}
