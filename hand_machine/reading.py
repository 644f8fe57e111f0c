"""Recordings of a machine: columns in SI on a uniform clock; what is wrong is left out and named.

Faults are found in the readings themselves, before any interpolation: an interpolated gap looks like slow motion, and a
spike between two samples of the clock would be lost or widened. Times are sorted, repeated ones are dropped.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import cumulative_trapezoid

from hand_machine.columns import read_columns
from hand_machine.description import MachineDescription
from hand_machine.settings import MACHINE
from hand_machine.spikes import find_off_the_motion, find_spikes
from hand_model.arrays import Array, Flags
from hand_recording.interpolation import bridge, in_force, interpolate
from hand_recording.recording_files import RecordingError
from hand_recording.settings import READING


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
    columns, grid, notes = read_columns(described, path)
    notes += _gap_notes(columns["position"].time_s)
    signals, known = {"input": np.zeros(len(grid))}, np.ones(len(grid), dtype=bool)
    for name, column in columns.items():
        shown = "pressure" if described.still else name
        good, lines = _without_faults(path, shown, column.time_s, column.values)
        late = np.maximum(grid - described.columns[name].delay_s, grid[0])
        if column.held:
            signals[name] = _in_force(late, column.time_s[good], column.values[good])
            notes += lines
            continue
        good, held, more = _without_repeats(shown, column.values, good)
        at, longest_s = _snapped(late, column.time_s[good]), held * _max_gap_s(column.time_s)
        signals[name], read = bridge(interpolate(at, column.time_s[good], column.values[good], longest_s))
        notes += lines + more
        known &= _settled(read, grid) if name == "input" else read
    if described.per_integral > 0.0:
        signals["input"] = signals["input"] + described.per_integral * _integral(grid, signals)
    return Readings(grid, signals, known, tuple(f"{path.name}: {line}" for line in notes))


def _integral(grid: Array, signals: Mapping[str, Array]) -> Array:
    """Where the commands of the speed (T,) lead from the first position [m or rad], with which the integral begins."""
    return np.asarray(signals["position"][0] + cumulative_trapezoid(signals["input"], grid, initial=0.0))


def _max_gap_s(time_s: Array) -> float:
    """Longest distance of two readings at the times (n,) [s] that is no gap [s]."""
    return READING.longest_gap_periods * float(np.median(np.diff(time_s)))


def _in_force(at_s: Array, time_s: Array, values: Array) -> Array:
    """The commands (n,) given at the times (n,) that hold at other times (T,); the first one also before it."""
    return values[np.maximum(in_force(at_s, time_s), 0)]


def _gap_notes(time_s: Array) -> list[str]:
    """A line about the stretches without any row."""
    intervals = np.diff(time_s)
    gaps = np.flatnonzero(intervals > _max_gap_s(time_s))
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
    if good.mean() < 1.0 - MACHINE.max_missing_readings:
        raise RecordingError(
            f"{path}: {1.0 - good.mean():.0%} of {name} is missing; at most {MACHINE.max_missing_readings:.0%} may be"
        )
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
    return np.where(np.abs(nearest - grid) < MACHINE.grid_rounding_periods * (grid[1] - grid[0]), nearest, grid)


def _settled(read: Flags, time_s: Array) -> Flags:
    """Where the input was read (T,) and has been for long enough; the beginning of a recording is no gap."""
    span = max(1, round(MACHINE.after_input_gap_s / float(time_s[1] - time_s[0])))
    missing = np.concatenate([[0], np.cumsum(~read)])
    return np.asarray(missing[1:] - missing[np.maximum(np.arange(len(read)) + 1 - span, 0)] == 0, dtype=bool)


def find_repeats(values: Array) -> tuple[Flags, float]:
    """Which finite readings (n,) [any unit] only repeat the one before, and how many rows the signal is held for; 1:
    it is not.

    A sensor may be read less often than its value is written down: between two of its values the table has the last
    one again, so that a moving axis seems to go by steps. A coarse encoder also repeats its readings, but goes on by
    single steps; one that goes on by several at once was not read in between.
    """
    none = np.zeros(len(values), dtype=bool)
    steps = np.abs(np.diff(values))
    moving = steps[steps > 0.0]
    if not len(moving) or 1.0 - len(moving) / len(steps) < MACHINE.least_repeated:
        return none, 1.0
    resolution = float(np.diff(np.unique(values)).min())
    if float(np.median(moving)) < MACHINE.least_held_steps * resolution:
        return none, 1.0
    changes = np.flatnonzero(np.r_[True, steps > 0.0])
    lengths = np.diff(np.r_[changes, len(values)])
    held = float(np.median(lengths))
    if held < 2.0:
        return none, 1.0
    run = np.repeat(np.arange(len(changes)), lengths)
    repeats = np.arange(len(values)) > changes[run]
    return repeats & (lengths[run] <= MACHINE.most_held * held), held
