"""The columns of a recording as the machine file names them: in SI, each with its own rising times.

Columns of a table share the times of their rows. Numbers of messages have those of their topic; the input of another
topic than the position is a command, which holds until the next one.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hand_machine.column_description import SENT, Column
from hand_machine.description import MachineDescription
from hand_machine.settings import MACHINE
from hand_machine.time_unit import check_time_unit
from hand_model.arrays import Array, Flags
from hand_model.effects.effect import ATMOSPHERE_PA
from hand_recording.message_numbers import is_recording, read_series, topic_of
from hand_recording.recording_files import RecordingError
from hand_recording.signal_files import uniform_clock
from hand_recording.table_file import Table, read_table


@dataclass(frozen=True, slots=True)
class Recorded:
    """Readings of one signal. time_s (n,): rising.  values (n,): SI.  held: whether each is in force until the next."""

    time_s: Array
    values: Array
    held: bool = False


def read_columns(described: MachineDescription, path: Path) -> tuple[dict[str, Recorded], Array, list[str]]:
    """Readings by the names of the file's columns, the uniform grid of the position's times (T,) [s], and lines about
    the times.

    Raises RecordingError, one line, for what cannot be used.
    """
    of_messages = described.columns["position"].is_of_messages
    if of_messages and not is_recording(path):
        raise RecordingError(f"{path} is a table; columns.position of {described.path.name} names a topic of rosbag2")
    if is_recording(path) and not of_messages:
        raise RecordingError(
            f"{path} is a recording of topics; columns of {described.path.name} must name numbers of their messages,"
            " as /joint_states.position[elbow]; --suggest-map proposes them"
        )
    return (_of_messages if of_messages else _of_table)(described, path)


def _of_table(described: MachineDescription, path: Path) -> tuple[dict[str, Recorded], Array, list[str]]:
    table = read_table(path)
    columns = {name: _column(table, path, column) for name, column in described.columns.items()}
    time_s, kept, notes = _times(path, described.columns["time"], columns.pop("time"))
    rows, grid = uniform_clock(path, time_s)
    notes += _stamp_notes(time_s, rows)
    return {name: Recorded(time_s[rows], values[kept][rows]) for name, values in columns.items()}, grid, notes


def _of_messages(described: MachineDescription, path: Path) -> tuple[dict[str, Recorded], Array, list[str]]:
    columns = {name: column for name, column in described.columns.items() if name != "time"}
    sent = "time" in described.columns and described.columns["time"].name == SENT
    series = read_series(path, [column.name for column in columns.values()], of_headers=not sent)
    position = columns["position"].name
    _check_samples(path, len(series[position].values))
    order, _ = uniform_clock(path, series[position].time_s)
    notes = list(dict.fromkeys(line for each in series.values() for line in each.notes))
    notes += _stamp_notes(series[position].time_s, order)
    read = {}
    for name, column in columns.items():
        own = series[column.name]
        order = np.unique(own.time_s, return_index=True)[1]
        held = name == "input" and topic_of(column.name) != topic_of(position)
        read[name] = Recorded(own.time_s[order], _in_si(column, own.values[order]), held)
    return _in_common(path, read, notes)


def _in_common(path: Path, read: dict[str, Recorded], notes: list[str]) -> tuple[dict[str, Recorded], Array, list[str]]:
    """The readings, the grid from the first to the last time at which all signals are known, and the lines."""
    position = read["position"]
    first = max(each.time_s[0] for each in read.values())
    last = min(each.time_s[-1] for each in read.values() if not each.held)
    inside = (position.time_s >= first) & (position.time_s <= last)
    if not inside.any():
        raise RecordingError(
            f"{path}: {' and '.join(read)} have no time in common; if their headers have different clocks,"
            f" state columns.time: {{column: {SENT}}}"
        )
    _check_samples(path, int(inside.sum()))
    left_s = first - position.time_s[0]
    if not inside[0]:
        latest = max(read, key=lambda name: read[name].time_s[0])
        notes.append(f"{latest} begins {left_s:.3g} s after the position; what is before is left out")
    _, grid = uniform_clock(path, position.time_s[inside])
    kept = Recorded(position.time_s[inside], position.values[inside], held=False)
    return read | {"position": kept}, grid, notes


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
    return _in_si(column, values)


def _in_si(column: Column, values: Array) -> Array:
    """Values (n,) of a column in SI."""
    taken_off = ATMOSPHERE_PA if column.pressure == "absolute" else 0.0
    return np.clip(column.scale * values + column.offset - taken_off, column.low, column.high)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _check_samples(path: Path, count: int) -> None:
    if count < MACHINE.min_samples:
        raise RecordingError(
            f"{path} has {count} samples; at least {MACHINE.min_samples} are needed; record for longer or faster"
        )


def _times(path: Path, column: Column, time_s: Array) -> tuple[Array, Flags, list[str]]:
    """Finite times (n,) [s], which rows have one, and lines about those that have none."""
    finite = np.isfinite(time_s)
    _check_samples(path, int(finite.sum()))
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
    uneven = float(np.mean(np.abs(intervals - period) > MACHINE.irregular_share * period))
    if uneven > MACHINE.irregular_share:
        notes.append(
            f"{uneven:.0%} of its intervals differ from their median by more than {MACHINE.irregular_share:.0%};"
            f" interpolated every {period:.4g} s"
        )
    return notes
