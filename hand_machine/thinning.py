"""Means over groups of samples, where recordings are long and sampled far faster than anything in them changes.

A group may be as large as its means still show every signal: what lies between them, by linear interpolation, is within
the noise of the readings or a share of the signal's range that no finding counts. The noise of a mean is that of all
its samples, so nothing is lost but time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hand_machine.reading import Readings
from hand_machine.settings import MACHINE
from hand_model.arrays import Array, Flags
from hand_recording.signals import white_noise


def thinned(tables: Sequence[Readings]) -> list[Readings]:
    """The recordings with means of as many samples as their number asks for and their signals allow, and a note."""
    wanted = -(-sum(len(table.time_s) for table in tables) // MACHINE.most_samples)
    groups = [_largest(table, wanted) for table in tables]
    means = [_means(table, group) for table, group in zip(tables, groups, strict=True)]
    if max(groups) > 1:
        used = " or ".join(str(group) for group in sorted(set(groups)) if group > 1)
        line = f"means of {used} samples are used: the recordings have many samples, and show nothing faster"
        means[0] = replace(means[0], notes=(*means[0].notes, line))
    return means


def _largest(table: Readings, wanted: int) -> int:
    """The largest group up to the wanted one whose means show every signal."""
    for group in range(min(wanted, len(table.time_s) // MACHINE.min_thinned_samples), 1, -1):
        if all(_shows(values, table.known, group) for values in table.signals.values()):
            return group
    return 1


def _shows(values: Array, known: Flags, group: int) -> bool:
    """Whether the means of groups show a signal (T,): what lies between them is noise, or too small to count."""
    at, means = _grouped(np.arange(len(values), dtype=float), group), _grouped(values, group)
    missed = (values - np.interp(np.arange(len(values)), at, means))[known]
    if not len(missed):
        return False
    noise = white_noise(values, known)
    small = MACHINE.thinned_share * float(np.ptp(values[known]))
    return float(np.sqrt(np.mean(missed**2))) <= float(np.hypot(noise, small))


def _grouped(values: Array, group: int) -> Array:
    """Means (T // group,) of values (T,)."""
    count = len(values) // group
    means: Array = values[: count * group].reshape(count, group).mean(axis=1)
    return means


def _means(table: Readings, group: int) -> Readings:
    """Means of groups of samples; known where all of them are."""
    if group < 2:
        return table
    time_s = _grouped(table.time_s, group)
    return Readings(
        time_s[0] + group * table.period_s * np.arange(len(time_s)),
        {name: _grouped(values, group) for name, values in table.signals.items()},
        _grouped(table.known.astype(float), group) == 1.0,
        table.notes,
    )
