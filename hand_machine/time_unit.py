"""The unit of a time column: seconds unless the machine file says otherwise; what looks different is refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from hand_machine.column_description import Column
from hand_model.arrays import Array
from hand_recording.recording_files import RecordingError

SECONDS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
"""Seconds in one unit, by the last word of a column's name."""
AS_YAML = {1.0: "1.0", 1e-3: "1.0e-3", 1e-6: "1.0e-6", 1e-9: "1.0e-9"}
"""Factors as YAML 1.1 reads them; it takes 1e-3 for a text."""


def named_time_unit(name: str) -> str | None:
    """The unit that the name of a column ends with, as `t_ms` and `Time [us]` do; None where there is none."""
    word = re.split(r"[^a-zµ]+", name.lower().rstrip(" )]"))[-1]
    return word if word in SECONDS else None


def check_time_unit(path: Path, column: Column, time_s: Array) -> None:
    """Refuse finite times (n,) [s] whose unit may be wrong: a name of another unit than the scale, or bare counts.

    Raises RecordingError, one line.
    """
    unit = named_time_unit(column.name)
    if unit is not None and not np.isclose(column.scale, SECONDS[unit], rtol=1e-6, atol=0.0):
        raise RecordingError(
            f"{path}: column {column.name!r} is named in {unit}, but its scale is {column.scale:g};"
            f" the machine file must have columns.time.scale: {AS_YAML[SECONDS[unit]]}"
        )
    if unit is None and not column.scale_given and np.all(time_s == np.round(time_s)):
        raise RecordingError(
            f"{path}: all times in column {column.name!r} are whole numbers; state their unit in the machine file:"
            " columns.time.scale is 1.0e-3 for ms, 1.0e-6 for us, 1.0 for s"
        )
