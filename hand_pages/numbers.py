"""Numbers as a reader expects them: an error with one digit, its value to the same place, no needless power of ten."""

from __future__ import annotations

import math

LEAST, MOST = 1e-4, 1e6
"""Sizes between which a number is written without a power of ten [-]."""


def with_error(value: float, std: float) -> str:
    """A value and its standard error, both in the same unit [any]: "0.0119 ± 0.0003", "66 ± 12".

    An error that begins with 1 has two digits.
    """
    if not (math.isfinite(value) and math.isfinite(std)) or std <= 0.0:
        return f"{value:.3g} ± {std:.1g}"
    place = math.floor(math.log10(std))
    if std < 1.95 * 10.0**place:
        place -= 1
    size = max(abs(value), std)
    if LEAST <= size < MOST:
        return f"{_at(value, place)} ± {_at(std, place)}"
    power = math.floor(math.log10(size))
    scaled = (_at(each * 10.0**-power, place - power) for each in (value, std))
    return f"({' ± '.join(scaled)})e{power}"


def _at(value: float, place: int) -> str:
    """A value rounded to a power of ten."""
    return f"{round(value, -place) + 0.0:.{max(-place, 0)}f}"
