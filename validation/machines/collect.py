"""Recordings of the machines, read from clones of the repositories that published them.

A clone is a folder `owner+name` or `name`, with a work tree or bare; the commit that `published.yaml` names must be in
it. Only the columns that the machine file uses are kept. `block: n` replaces n rows by their mean.
"""

from __future__ import annotations

import io
import json
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from hand_model.arrays import Array
from validation.machines.cases import Case

Columns = dict[str, Array]


def collect(cases: Sequence[Case], clones: Path, data: Path, progress: Callable[[str], None]) -> list[str]:
    """Write the recordings as data/MACHINE/NAME.npz; one line for each source that has no clone there.

    ValueError: a file or column that its source does not have.
    """
    missing = []
    for case in cases:
        clone = find_clone(clones, case.source["repository"])
        if clone is None:
            missing.append(f"{case.name}: no clone of {case.source['repository']} in {clones}")
            continue
        (data / case.name).mkdir(parents=True, exist_ok=True)
        for name, recording in case.recordings.items():
            columns = read_columns(_show(clone, case.source["commit"], recording["path"]), recording)
            np.savez_compressed(data / case.name / name, **columns)  # type: ignore[arg-type]
            progress(f"{case.name}/{name}: {len(next(iter(columns.values())))} rows")
    return missing


def find_clone(clones: Path, repository: str) -> Path | None:
    """The git directory of a repository's clone in a folder."""
    owner, _, name = repository.partition("/")
    for folder in (clones / f"{owner}+{name}" / "repo", clones / f"{owner}+{name}", clones / name):
        for path in (folder / ".git", folder):
            if (path / "HEAD").is_file():
                return path
    return None


def _show(clone: Path, commit: str, path: str) -> bytes:
    done = subprocess.run(
        ["git", "--git-dir", str(clone), "show", f"{commit}:{path}"], capture_output=True, check=False
    )
    if done.returncode != 0:
        raise ValueError(f"{clone}: {done.stderr.decode(errors='replace').strip()}")
    return done.stdout


def read_columns(content: bytes, recording: Mapping[str, Any]) -> Columns:
    """Columns of one recording, by its entry in published.yaml. ValueError: a column that is not there.

    Formats: csv (a header, commas; `names` in place of it), table (white space or `delimiter`, `names`), mat (`places`
    of nested values), json (rows under `key`, `names`). `constants` are columns with one value.
    """
    columns = _FORMATS[recording["format"]](content, recording)
    count = len(next(iter(columns.values())))
    columns |= {name: np.full(count, float(value)) for name, value in recording.get("constants", {}).items()}
    period = recording.get("sample_period_s")
    if period is not None:
        columns["t"] = period * np.arange(count, dtype=np.float64)
    wanted = [*recording["columns"], *(["t"] if period is not None else [])]
    absent = [name for name in wanted if name not in columns]
    if absent:
        raise ValueError(f"{recording['path']} has no column {', '.join(absent)}; it has: {', '.join(columns)}")
    first, last = recording.get("rows", (0, None))
    block, offsets = int(recording.get("block", 1)), recording.get("offsets", {})
    return {name: _blocks(columns[name][first:last], block) - offsets.get(name, 0.0) for name in wanted}


def _blocks(values: Array, block: int) -> Array:
    """Means of blocks of rows (n // block,)."""
    count = len(values) // block
    return np.asarray(values[: count * block].reshape(count, block).mean(axis=1))


def _csv(content: bytes, recording: Mapping[str, Any]) -> Columns:
    head, _, body = content.decode().replace('"', "").partition("\n")
    delimiter = "," if "," in head else None
    names = recording.get("names") or [name.strip() for name in head.split(delimiter)]
    return _named(names, np.genfromtxt(io.StringIO(body), delimiter=delimiter, ndmin=2))  # an empty place is NaN


def _table(content: bytes, recording: Mapping[str, Any]) -> Columns:
    delimiter, comments = recording.get("delimiter"), recording.get("comments", "#")
    return _named(recording["names"], np.loadtxt(io.BytesIO(content), delimiter=delimiter, comments=comments, ndmin=2))


def _mat(content: bytes, recording: Mapping[str, Any]) -> Columns:
    read = scipy.io.loadmat(io.BytesIO(content), squeeze_me=True, struct_as_record=False)
    places = recording.get("places") or {name: [name] for name in read if not name.startswith("__")}
    return {name: np.ravel(_nested(read, place)).astype(np.float64) for name, place in places.items()}


def _nested(value: Any, place: Sequence[str | int]) -> Any:
    """What lies at a place within nested structures and cells: names of fields, numbers of cells."""
    for part in place:
        value = value[part] if isinstance(value, Mapping) or isinstance(part, int) else getattr(value, part)
    return value


def _json(content: bytes, recording: Mapping[str, Any]) -> Columns:
    return _named(recording["names"], np.array(json.loads(content)[recording["key"]], dtype=np.float64))


def _named(names: Sequence[str], rows: Array) -> Columns:
    return {name: rows[:, k] for k, name in enumerate(names) if k < rows.shape[1]}


_FORMATS: dict[str, Callable[[bytes, Mapping[str, Any]], Columns]] = {
    "csv": _csv,
    "table": _table,
    "mat": _mat,
    "json": _json,
}
