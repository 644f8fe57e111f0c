"""A chart of the errors of two reports in multiples of the noise: a row per joint and signal, on a logarithmic axis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hand_diagnosis.pages.headline import multiple, short
from hand_diagnosis.settings import SETTINGS

Errors = Mapping[tuple[str, str], Mapping[str, Any]]
Pair = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Bar:
    """The error of one report. before, after: places on the axis, 0 to 100 [%].  text: both, times the noise."""

    before: float
    after: float
    text: str


@dataclass(frozen=True, slots=True)
class ErrorChart:
    """What compare.html draws.

    rows: joint and signal, with the bars of A and B; None where a report has no such error.  ticks: place [%] and text.
    noise: place of 1, up to which an error is noise [%].  alt: the result in a sentence.
    """

    rows: tuple[tuple[str, Bar | None, Bar | None], ...]
    ticks: tuple[tuple[float, str], ...]
    noise: float
    alt: str


def error_chart(first: Errors, second: Errors) -> ErrorChart | None:
    """The chart of the errors of two reports, by joint and signal; None where neither has any."""
    keys = sorted(set(first) | set(second))
    pairs = [(key, _multiples(first.get(key)), _multiples(second.get(key))) for key in keys]
    every = [value for _, *both in pairs for each in both if each for value in each if value > 0.0]
    if not every:
        return None
    low, high = min(SETTINGS.chart_low, *every), max(SETTINGS.chart_high, *every)

    def place(value: float) -> float:
        return round(100.0 * math.log(max(value, low) / low) / math.log(high / low), 2)

    def bar(both: Pair | None) -> Bar | None:
        return None if both is None else Bar(place(both[0]), place(both[1]), f"{short(both[0])} → {short(both[1])}")

    rows = tuple((f"{key[0]}, {key[1]}", bar(a), bar(b)) for key, a, b in pairs)
    powers = range(math.ceil(math.log10(low)), math.floor(math.log10(high)) + 1)
    ticks = tuple((place(10.0**power), f"{10.0**power:g}") for power in powers)
    return ErrorChart(rows, ticks, place(1.0), _alt(pairs))


def _multiples(row: Mapping[str, Any] | None) -> Pair | None:
    return None if row is None else (multiple(row, "rmse_before"), multiple(row, "rmse_after"))


def _alt(pairs: Sequence[tuple[tuple[str, str], Pair | None, Pair | None]]) -> str:
    """The largest error of each report before its fit, and what is left of it."""
    sides = {
        "A": [(a, key) for key, a, _ in pairs if a is not None],
        "B": [(b, key) for key, _, b in pairs if b is not None],
    }
    parts = []
    for side, known in sides.items():
        if known:
            (before, after), (joint, signal) = max(known)
            parts.append(f"{side}: the largest error is that of {joint}, {signal}, {short(before)} → {short(after)}")
    return f"{'; '.join(parts)} times the noise"
