"""The machines whose recordings are examined: what is described here, and where the recordings come from.

Each folder next to this module has a machine file (docs/machines.md), which leaves the known effects out, and
`published.yaml`: the source with its licence, the recordings, which of them are test data, and what is published. The
recordings themselves are not part of this repository; `collect` reads them from clones of their sources.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from validation.trial import reality

FOLDER = Path(__file__).resolve().parent
OLDER_TESTS = {
    "seal NAPN": ("friction__NAPN_5bar",),
    "seal O-ring257": ("friction__O-ring257_5bar",),
    "servo, driven": ("servo_100_sin_sin",),
    "servo, falling": ("servo_400_lift_and_drop",),
}
"""Test recordings of the machines of validation/trial/reality.py."""


@dataclass(frozen=True, slots=True)
class Case:
    """A machine. Names of recordings are those of their files in the folder of data.

    known: effects that it has by its source; each is a set of names that count as the same (an isolability class).
    decoys: effects that it is not known to have.  published: by key of the report, mappings with value and source.
    tolerance: relative standard deviation of the nominal numbers that have none of their own [-].
    source: mapping with repository, commit, licence and about.
    """

    name: str
    title: str
    machine: Path
    recordings: Mapping[str, Mapping[str, Any]]
    test: tuple[str, ...]
    known: tuple[frozenset[str], ...]
    decoys: tuple[str, ...]
    published: Mapping[str, Mapping[str, Any]]
    tolerance: float
    source: Mapping[str, str]

    @property
    def train(self) -> tuple[str, ...]:
        """The recordings that are not test data."""
        return tuple(name for name in self.recordings if name not in self.test)


def described_cases(folder: Path = FOLDER) -> list[Case]:
    """The machines with a folder here, in the order of their names. ValueError: a test recording that is not listed."""
    return [_read(path) for path in sorted(folder.glob("*/published.yaml"))]


def _read(path: Path) -> Case:
    top = yaml.safe_load(path.read_text(encoding="utf-8"))
    missing = [name for name in top["test"] if name not in top["recordings"]]
    if missing:
        raise ValueError(f"{path}: test has {', '.join(missing)}, which recordings does not list")
    return Case(
        name=path.parent.name,
        title=top["title"],
        machine=path.parent / "machine.yaml",
        recordings=top["recordings"],
        test=tuple(top["test"]),
        known=tuple(frozenset(part.strip() for part in entry.split("|")) for entry in top["known"]),
        decoys=tuple(top["decoys"]),
        published=top["published"],
        tolerance=float(top["tolerance"]),
        source=top["source"],
    )


def older_cases(data: Path, out: Path) -> list[Case]:
    """The machines of validation/trial/reality.py whose recordings are in a folder; their tables are written into out.

    They come without a folder here, because their recordings need more than a choice of columns.
    """
    try:
        found = reality.machines(data)
    except FileNotFoundError:
        return []
    return [_older(machine, out) for machine in found]


def _older(machine: reality.Machine, out: Path) -> Case:
    folder = out / machine.name.replace(",", "").replace(" ", "_").replace("-", "_").lower()
    recordings = reality.write_recordings(machine, folder)
    test = OLDER_TESTS[machine.name]
    return Case(
        name=folder.name,
        title=machine.name,
        machine=folder / "machine.yaml",
        recordings={path.name: {"path": str(path.resolve())} for path in recordings},
        test=tuple(f"{name}.npz" for name in test),
        known=tuple(frozenset({name}) for name in machine.known),
        decoys=machine.decoys,
        published={key: {"value": value, "source": source} for key, (value, source) in machine.published.items()},
        tolerance=machine.tolerance,
        source={"about": "see the section Real machines of docs/proof.md"},
    )


def files(case: Case, data: Path, names: Sequence[str]) -> list[Path]:
    """Paths of recordings. FileNotFoundError: one is not in the folder of data."""
    paths = [Path(case.recordings[name].get("path", "")) for name in names]
    if not all(path.is_absolute() for path in paths):
        paths = [data / case.name / name for name in names]
    for path in paths:
        if not path.is_file():
            raise FileNotFoundError(f"{path} does not exist; python -m validation.machines collect writes it")
    return paths
