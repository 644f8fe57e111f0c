"""Tables of numbers: the one reader of CSV, Parquet, NPZ and MAT files, and columns by quantity and unit.

A column of a rig's table is named quantity_unit. A known unit is converted into the one that is asked for, and angles
are checked for degrees and radians being mixed up.
"""

from __future__ import annotations

import csv
import importlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.io import loadmat

from hand_model.arrays import Array
from hand_recording.recording_files import RecordingError
from hand_recording.settings import READING

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
"""Factors of the units of a quantity, by the unit that the program asks for."""
TABLES = {".csv", ".parquet", ".pq", ".npz", ".mat"}
"""Names of the files that read_table reads end with one of these."""
CHUNK = 1 << 20
"""Bytes of a text file that are read at a time to count its lines."""


@dataclass(frozen=True)
class Table:
    """The columns of a file by name, in its order: numbers (n,), NaN for empty cells; or the text of each cell.

    lines: number of each row's line in a CSV file; of other files the number of the row, from 1.
    """

    path: Path
    columns: dict[str, Array | list[str]]
    lines: Sequence[int]

    @property
    def numbers(self) -> dict[str, Array]:
        """The columns that hold nothing but numbers and empty cells."""
        return {name: column for name, column in self.columns.items() if isinstance(column, np.ndarray)}

    def finite(self, name: str) -> Array:
        """A column (n,) [its unit] of finite numbers. Raises RecordingError that names the first cell with another."""
        column = self.columns[name]
        values = np.array([_number(cell) for cell in column]) if isinstance(column, list) else column
        wrong = np.flatnonzero(~np.isfinite(values))
        if len(wrong):
            cell = str(column[wrong[0]])
            shown = f"{cell!r} or empty" if cell == "nan" else repr(cell)
            line = self.lines[int(wrong[0])]
            raise RecordingError(f"{self.path}: line {line}, column {name} is {shown}; it must be a finite number")
        return values


def read_table(path: Path) -> Table:
    """The columns of a CSV file with a header, a Parquet or MAT file, or an NPZ archive of vectors of equal length.

    In a CSV file, empty lines and lines that begin with # are left out. Of a MAT file (up to version 7.2), the numeric
    vectors of the largest length are read, also those in structures, named `structure.field`.  Raises RecordingError,
    one line, for what cannot be read and for more than READING.max_samples rows.
    """
    try:
        if path.suffix == ".npz":
            with np.load(path) as archive:
                columns = {name: np.asarray(archive[name], dtype=np.float64) for name in archive.files}
        elif path.suffix in {".parquet", ".pq"}:
            columns = _parquet(path)
        elif path.suffix == ".mat":
            columns = _mat(path)
        else:
            return _csv(path)
    except FileNotFoundError:
        raise RecordingError(f"{path} does not exist") from None
    except NotImplementedError:  # how scipy refuses version 7.3, which is HDF5
        raise RecordingError(f"{path} is a MAT file of version 7.3; save it with: save(..., '-v7')") from None
    except (OSError, UnicodeDecodeError, csv.Error, ValueError, TypeError) as error:
        if isinstance(error, RecordingError):
            raise
        kind = "CSV" if path.suffix == ".csv" else "a table"
        raise RecordingError(f"{path}: cannot be read as {kind} ({str(error).splitlines()[0]})") from None
    lengths = {column.shape for column in columns.values()}
    if len(lengths) != 1 or len(next(iter(lengths))) != 1:
        raise RecordingError(f"{path}: its columns must be vectors of equal length; they are {sorted(lengths)}")
    rows = next(iter(lengths))[0]
    _check_rows(path, rows)
    return Table(path, dict(columns), range(1, rows + 1))


def _check_rows(path: Path, rows: int) -> None:
    if rows > READING.max_samples:
        raise RecordingError(
            f"{path} has {rows} rows; the allowed range is up to {READING.max_samples}; keep every"
            f" {-(-rows // READING.max_samples)}th row, or cut it into several recordings"
        )


def _mat(path: Path) -> dict[str, Array]:
    """The numeric vectors of the largest length, in structures too; other variables are settings."""
    content = loadmat(path, squeeze_me=True, struct_as_record=False, chars_as_strings=True)
    columns = dict(_vectors({name: value for name, value in content.items() if not name.startswith("__")}, ""))
    if not columns:
        raise RecordingError(f"{path} holds no vectors of numbers")
    longest = max(map(len, columns.values()))
    return {name: values for name, values in columns.items() if len(values) == longest}


def _vectors(content: dict[str, object], within: str) -> Iterator[tuple[str, Array]]:
    """The numeric vectors of the variables of a MAT file or of the fields of a structure."""
    for name, value in content.items():
        fields = getattr(value, "_fieldnames", None)
        if fields is not None:
            yield from _vectors({field: getattr(value, field) for field in fields}, f"{within}{name}.")
        elif isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "fiub":
            yield f"{within}{name}", np.asarray(value, dtype=np.float64)


def _parquet(path: Path) -> dict[str, Array]:
    """Parquet is read where pyarrow is installed; what a robot runs does not need it."""
    try:
        parquet = importlib.import_module("pyarrow.parquet")
    except ModuleNotFoundError:
        raise RecordingError(
            f"{path}: reading Parquet needs pyarrow; install it with: pip install 'fluidic_hand[analysis]'"
        ) from None
    table = parquet.read_table(path)
    columns = {}
    for name in table.column_names:
        try:
            columns[name] = np.asarray(table.column(name).to_numpy(zero_copy_only=False), dtype=np.float64)
        except (TypeError, ValueError):
            continue  # text between the numbers
    return columns


def _csv(path: Path) -> Table:
    with path.open("rb") as stream:  # counted first: numbers as text take 20 times the memory
        _check_rows(path, sum(chunk.count(b"\n") for chunk in iter(lambda: stream.read(CHUNK), b"")) - 1)
    with path.open(newline="", encoding="utf-8-sig") as stream:
        reader = csv.reader(stream)
        rows = [(reader.line_num, row) for row in reader if any(map(str.strip, row)) and row[0].lstrip()[:1] != "#"]
    if not rows:
        raise RecordingError(f"{path} is empty; a header line and numbers are needed")
    header = [cell.strip() for cell in rows[0][1]]
    if len(rows) == 1:
        raise RecordingError(f"{path} has a header and no numbers")
    for line, row in rows[1:]:
        if len(row) != len(header):
            raise RecordingError(f"{path}: line {line} has {len(row)} cells; the header has {len(header)}")
    if len(set(header)) < len(header):
        twice = next(name for name in header if header.count(name) > 1)
        raise RecordingError(f"{path}: the header names the column {twice!r} twice")
    cells = zip(*(row for _, row in rows[1:]), strict=True)
    columns = {name: _column([cell.strip() for cell in column]) for name, column in zip(header, cells, strict=True)}
    return Table(path, columns, [line for line, _ in rows[1:]])


def _column(cells: list[str]) -> Array | list[str]:
    """Numbers, NaN for empty cells; the cells themselves where any other text is among them."""
    try:
        return np.array([float(cell) if cell else np.nan for cell in cells])
    except ValueError:
        return cells


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")


def read_rig(path: Path, wanted: Sequence[str], optional: Sequence[str] = ()) -> dict[str, Array]:
    """Columns (n,) of a table by the names asked for, such as "pressure_pa", converted from the unit of the file.

    Raises RecordingError for a missing file or column, a cell that is not a finite number, and angles that look as
    if they were in the other unit.
    """
    table = read_table(path)
    found: dict[str, Array] = {}
    for name in (*wanted, *optional):
        column = _find(table, name)
        if column is None:
            if name in wanted:
                raise RecordingError(f"{path}: has no column {name}; it has: {', '.join(table.columns)}")
            continue
        own_name, factor = column
        found[name] = factor * table.finite(own_name)
        if name.endswith("_deg"):
            _check_angle(path, own_name, found[name], factor)
    return found


def _find(table: Table, name: str) -> tuple[str, float] | None:
    """Name and factor of the column that holds a quantity, in whichever unit."""
    quantity, _, unit = name.rpartition("_")
    for other, factor in UNITS[unit].items():
        if f"{quantity}_{other}" in table.columns:
            return f"{quantity}_{other}", factor / UNITS[unit][unit]
    return None


def _check_angle(path: Path, column: str, angle_deg: Array, factor: float) -> None:
    largest = float(np.abs(angle_deg).max())
    moved, radians = READING.radians_range_deg
    if factor == 1.0 and np.ptp(angle_deg) > moved and largest < radians:
        raise RecordingError(
            f"{path}: {column} stays within {largest:.3g}; if these are radians, name the column"
            f" {column.removesuffix('_deg')}_rad"
        )
    if largest > READING.max_table_angle_deg:
        meant = f"; if these are degrees, name it {column.removesuffix('_rad')}_deg" if factor != 1.0 else ""
        raise RecordingError(f"{path}: {column} reaches {largest / factor:.4g}; the allowed range is one turn{meant}")
