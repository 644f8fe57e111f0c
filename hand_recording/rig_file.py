"""Rig recordings as tables: CSV with a header, units in the column names; or a rosbag2 recording of a rig.

A column is named quantity_unit. Known units are turned into the one that is asked for; angles are checked for being
given in the wrong one.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hand_model.arrays import Array

UNITS: dict[str, dict[str, float]] = {
    "pa": {"pa": 1.0, "kpa": 1e3, "mbar": 1e2, "bar": 1e5, "mpa": 1e6},
    "deg": {"deg": 1.0, "rad": 180.0 / np.pi},
    "nm": {"nm": 1.0, "mnm": 1e-3, "ncm": 1e-2},
    "n": {"n": 1.0, "mn": 1e-3},
    "v": {"v": 1.0, "mv": 1e-3},
    "m3": {"m3": 1.0, "cm3": 1e-6, "ml": 1e-6, "mm3": 1e-9},
    "s": {"s": 1.0, "ms": 1e-3},
    "ohm": {"ohm": 1.0, "kohm": 1e3},
}


class RigError(ValueError):
    """A rig file cannot be used; the message is one line that names file and problem."""


def read_rig(path: Path, wanted: Sequence[str], optional: Sequence[str] = ()) -> dict[str, Array]:
    """Columns of a CSV, each (n,), by the names asked for, such as "pressure_pa"; another unit is converted.

    Raises RigError for a missing file or column, a cell that is no number, or angles that look like radians.
    """
    header, rows = _read(path)
    table: dict[str, Array] = {}
    for name in (*wanted, *optional):
        found = _find(header, name)
        if found is None:
            if name in wanted:
                raise RigError(f"{path}: has no column {name}; it has: {', '.join(header)}")
            continue
        column, factor = found
        table[name] = factor * _numbers(path, header, rows, column)
        if name.endswith("_deg"):
            _check_angle(path, header[column], table[name], factor)
    return table


def _read(path: Path) -> tuple[list[str], list[list[str]]]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            lines = [line for line in csv.reader(stream) if any(cell.strip() for cell in line)]
    except FileNotFoundError:
        raise RigError(f"{path} does not exist") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise RigError(f"{path}: cannot be read as CSV ({error})") from None
    lines = [line for line in lines if not line[0].lstrip().startswith("#")]
    if not lines:
        raise RigError(f"{path} is empty; a header line and numbers are needed")
    header = [cell.strip() for cell in lines[0]]
    if len(lines) == 1:
        raise RigError(f"{path} has a header and no numbers")
    return header, lines[1:]


def _find(header: list[str], name: str) -> tuple[int, float] | None:
    """Index and factor of the column that holds a quantity, in whichever unit."""
    quantity, _, unit = name.rpartition("_")
    for other, factor in UNITS[unit].items():
        if f"{quantity}_{other}" in header:
            return header.index(f"{quantity}_{other}"), factor / UNITS[unit][unit]
    return None


def _numbers(path: Path, header: list[str], rows: list[list[str]], column: int) -> Array:
    values = np.empty(len(rows))
    for index, row in enumerate(rows):
        cell = row[column].strip() if column < len(row) else ""
        try:
            values[index] = float(cell)
        except ValueError:
            values[index] = np.nan
        if not np.isfinite(values[index]):
            raise RigError(f"{path}: line {index + 2}, column {header[column]} is {cell!r}; it must be a finite number")
    return values


def _check_angle(path: Path, column: str, angle_deg: Array, factor: float) -> None:
    largest = float(np.abs(angle_deg).max())
    if factor == 1.0 and np.ptp(angle_deg) > 0.2 and largest < 3.2:
        raise RigError(
            f"{path}: {column} stays within {largest:.3g}; if these are radians, name the column"
            f" {column.removesuffix('_deg')}_rad"
        )
    if largest > 360.0:
        meant = f"; if these are degrees, name it {column.removesuffix('_rad')}_deg" if factor != 1.0 else ""
        raise RigError(f"{path}: {column} reaches {largest / factor:.4g}; the allowed range is one turn{meant}")
