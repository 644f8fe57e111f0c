"""Recordings of a machine: columns of a table in SI on a uniform clock; what is wrong is left out and named.

Faults are found in the readings themselves, before any interpolation: an interpolated gap looks like slow motion, and a
spike between two samples of the clock would be lost or widened. Times are sorted, repeated ones are dropped.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hand_machine.description import Column, MachineDescription
from hand_machine.held import find_repeats
from hand_machine.spikes import find_off_the_motion, find_spikes
from hand_machine.time_unit import check_time_unit
from hand_model.arrays import Array, Flags
from hand_model.effects.effect import ATMOSPHERE_PA
from hand_recording.interpolation import LONGEST_GAP_PERIODS, bridge, interpolate
from hand_recording.recording_files import RecordingError
from hand_recording.signal_files import uniform_clock
from hand_recording.table_file import Table, read_table

MIN_SAMPLES = 100
"""Fewest rows of a recording; the last fifth is test data, and no effect can be confirmed on fewer than 20 samples."""
MAX_MISSING = 0.5
"""Largest share of a column that may be missing, not finite or a spike."""
AFTER_INPUT_GAP_S = 0.5
"""Time after a gap of the input during which the state that the missing input has left is not evaluated."""
ROUNDING = 1e-3
"""Share of the period within which two times are the same."""
IRREGULAR = 0.2
"""Share of the period by which intervals differ that are called irregular."""


@dataclass(frozen=True, slots=True)
class Readings:
    """A recording in SI on a uniform clock.

    time_s (T,).  signals: (T,) each, `input`, `position` and, where the motion is imposed, `force`; bridged where not
    known.  known: (T,) where all of them were read.  notes: lines about what was wrong and is left out.
    """

    time_s: Array
    signals: Mapping[str, Array]
    known: Flags
    notes: tuple[str, ...]

    @property
    def period_s(self) -> float:
        """Distance of the samples [s]."""
        return float(self.time_s[1] - self.time_s[0])


def read_machine(described: MachineDescription, path: Path) -> Readings:
    """A recording of the machine. Raises RecordingError, one line, for what cannot be used."""
    table = read_table(path)
    columns = {name: _column(table, path, column) for name, column in described.columns.items()}
    time_s, kept, notes = _times(path, described.columns["time"], columns.pop("time"))
    rows, grid = uniform_clock(path, time_s)
    notes += _stamp_notes(time_s, rows)
    time_s = time_s[rows]
    max_gap = LONGEST_GAP_PERIODS * float(np.median(np.diff(time_s)))
    notes += _gap_notes(time_s, max_gap)
    signals, known = {"input": np.zeros(len(grid))}, np.ones(len(grid), dtype=bool)
    for name, values in columns.items():
        readings = values[kept][rows]
        good, lines = _without_faults(path, name, time_s, readings)
        good, held, more = _without_repeats(name, readings, good)
        late = np.maximum(grid - described.columns[name].delay_s, grid[0])
        at, longest_s = _snapped(late, time_s[good]), held * max_gap
        signals[name], read = bridge(interpolate(at, time_s[good], readings[good], longest_s))
        notes += lines + more
        known &= _settled(read, grid) if name == "input" else read
    return Readings(grid, signals, known, tuple(f"{path.name}: {line}" for line in notes))


def _column(table: Table, path: Path, column: Column) -> Array:
    """A column (n,) in SI."""
    if column.name not in table.columns:
        raise RecordingError(f"{path} has no column {column.name!r}; it has: {', '.join(table.columns)}")
    values = table.columns[column.name]
    if isinstance(values, list):
        line, cell = next(
            (line, cell) for line, cell in zip(table.lines, values, strict=True) if cell and not _is_number(cell)
        )
        raise RecordingError(f"{path}: line {line}, column {column.name!r} is {cell!r}; it must be a number")
    taken_off = ATMOSPHERE_PA if column.pressure == "absolute" else 0.0
    return np.clip(column.scale * values + column.offset - taken_off, column.low, column.high)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _times(path: Path, column: Column, time_s: Array) -> tuple[Array, Flags, list[str]]:
    """Finite times (n,) [s], which rows have one, and lines about those that have none."""
    finite = np.isfinite(time_s)
    if finite.sum() < MIN_SAMPLES:
        raise RecordingError(
            f"{path} has {finite.sum()} samples; at least {MIN_SAMPLES} are needed; record for longer or faster"
        )
    if np.ptp(time_s[finite]) == 0.0:
        raise RecordingError(
            f"{path}: column {column.name!r} is constant at {time_s[finite][0]:g}; it must hold rising times"
        )
    check_time_unit(path, column, time_s[finite])
    lost = int((~finite).sum())
    return time_s[finite], finite, [f"{lost} rows without a time; left out"] if lost else []


def _stamp_notes(time_s: Array, rows: NDArray[np.intp]) -> list[str]:
    """Lines about times (n,) [s] that are out of order, repeated or irregular. rows: those that are kept."""
    notes = []
    back = int((np.diff(time_s) < 0.0).sum())
    if back:
        notes.append(f"times go back at {back} rows; sorted")
    if len(rows) < len(time_s):
        notes.append(f"{len(time_s) - len(rows)} repeated times; the first row of each is kept")
    intervals = np.diff(time_s[rows])
    period = float(np.median(intervals))
    uneven = float(np.mean(np.abs(intervals - period) > IRREGULAR * period))
    if uneven > IRREGULAR:
        notes.append(
            f"{uneven:.0%} of its intervals differ from their median by more than {IRREGULAR:.0%};"
            f" interpolated every {period:.4g} s"
        )
    return notes


def _gap_notes(time_s: Array, max_gap_s: float) -> list[str]:
    """A line about the stretches without any row."""
    intervals = np.diff(time_s)
    gaps = np.flatnonzero(intervals > max_gap_s)
    if not len(gaps):
        return []
    longest = int(gaps[np.argmax(intervals[gaps])])
    count = f"{len(gaps)} gap{'s' if len(gaps) > 1 else ''}, the longest of"
    return [f"{count} {intervals[longest]:.3g} s at {time_s[longest] - time_s[0]:.3g} s; left out"]


def _without_faults(path: Path, name: str, time_s: Array, values: Array) -> tuple[Flags, list[str]]:
    """Which readings (n,) of a signal are good, and lines about the others. Raises RecordingError for too few."""
    finite = np.isfinite(values)
    if not finite.any():
        raise RecordingError(f"{path}: {name} holds no finite number")
    good = finite.copy()
    spikes = find_off_the_motion(time_s[finite], values[finite]) if name == "position" else None
    good[finite] = ~(find_spikes(values[finite], pulses=name == "input") if spikes is None else spikes)
    if good.mean() < 1.0 - MAX_MISSING:
        raise RecordingError(f"{path}: {1.0 - good.mean():.0%} of {name} is missing; at most {MAX_MISSING:.0%} may be")
    if name != "input" and np.ptp(values[good]) == 0.0:
        raise RecordingError(f"{path}: {name} is constant at {values[good][0]:g}; it must change")
    notes = []
    if not finite.all():
        first = time_s[int(np.argmin(finite))] - time_s[0]
        notes.append(
            f"{name}: {int((~finite).sum())} readings are missing or not finite, first at {first:.3g} s; left out"
        )
    spikes = finite & ~good
    if spikes.any():
        where = np.flatnonzero(spikes)
        height = float(np.abs(values[where] - np.median(values[good])).max())
        first = time_s[where[0]] - time_s[0]
        notes.append(
            f"{name}: {len(where)} spike{'s' if len(where) > 1 else ''}, first at {first:.3g} s,"
            f" up to {height:.3g} away from the median; left out"
        )
    return good, notes


def _without_repeats(name: str, values: Array, good: Flags) -> tuple[Flags, float, list[str]]:
    """The good readings (n,) of a signal that do not only repeat the one before; rows a reading is held for; a line."""
    if name == "input":  # a command is held until the next one
        return good, 1.0, []
    repeats, held = find_repeats(values[good])
    kept = good.copy()
    kept[good] = ~repeats
    line = f"{name}: held for {held:.0f} rows and more at a time; only the rows at which it changes are used"
    return kept, held, [line] if held > 1.0 else []


def _snapped(grid: Array, time_s: Array) -> Array:
    """A grid (T,) with the very times (n,) of readings where it misses them by rounding alone, as next to a gap."""
    after = np.minimum(np.searchsorted(time_s, grid), len(time_s) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(time_s[after] - grid) < np.abs(time_s[before] - grid), time_s[after], time_s[before])
    return np.where(np.abs(nearest - grid) < ROUNDING * (grid[1] - grid[0]), nearest, grid)


def _settled(read: Flags, time_s: Array) -> Flags:
    """Where the input was read (T,) and has been for long enough; the beginning of a recording is no gap."""
    span = max(1, round(AFTER_INPUT_GAP_S / float(time_s[1] - time_s[0])))
    missing = np.concatenate([[0], np.cumsum(~read)])
    return np.asarray(missing[1:] - missing[np.maximum(np.arange(len(read)) + 1 - span, 0)] == 0, dtype=bool)
