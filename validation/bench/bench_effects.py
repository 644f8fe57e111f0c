"""Every effect alone, at twice its detection limit, in a good excitation: is it named first, placed and located?

The recordings are those of `hand trial`: its independent plant in other forms, a nominal model that is a few percent
off, half a minute at 100 Hz, of which a quarter each are a slow triangle, steps, a multisine and a staircase.
"""

from __future__ import annotations

import tempfile
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hand_diagnosis.diagnose import diagnose
from hand_diagnosis.inputs import read_signals
from hand_diagnosis.report import document
from hand_model.description import load_hand
from validation.bench.result import figure
from validation.trial.catalogue import KNOWN
from validation.trial.grade import Grade, grade
from validation.trial.make import Case, make_case, write_models
from validation.trial.nominal import Nominal

SEED, ROUNDS, MULTIPLE, MOTION = 17, 4, 2.0, "mixed"
MODEL = Path(__file__).parents[2] / "config" / "hand.yaml"


@dataclass(frozen=True, slots=True)
class Row:
    """One effect's recordings: those that show it, and in how many it came first, on its joint, in its place."""

    effect: str
    shown: int
    first: int
    joint: int
    place: int
    probability: float
    instead: tuple[str, ...]


def run(quick: bool) -> list[dict[str, Any]]:
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    names = [one.name for one in KNOWN][: 3 if quick else None] * (1 if quick else ROUNDS)
    cases = [Case(k, int(rng.integers(2**31)), "single", [(name, MULTIPLE)], MOTION) for k, name in enumerate(names)]
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(2) as pool:
        write_models(Nominal(MODEL), Path(folder))
        graded = list(pool.map(_judge, [(case, folder) for case in cases]))
    rows = _rows(graded)
    print(markdown(rows))
    shown = sum(row.shown for row in rows)
    missed = {what: sum(row.shown - getattr(row, what) for row in rows) for what in ("first", "place", "joint")}
    return [
        figure("effects at 2x their limit: not named first", missed["first"] / shown, 0.0, "share"),
        figure("  not in the right place", missed["place"] / shown, 0.0, "share"),
        figure("  not on the right joint", missed["joint"] / shown, 0.0, "share"),
    ]


def _judge(work: tuple[Case, str]) -> tuple[str, Grade | None, float]:
    """Effect, grade (None where no joint shows it within what is usual), probability of the first finding."""
    case, folder = work
    name = case.effects[0][0]
    case = make_case((case, str(MODEL), folder))
    if not case.truth:
        return name, None, 0.0
    hand = load_hand(Path(folder) / case.model)
    recording = Path(folder) / "recordings" / f"case_{case.number:04d}.mcap"
    result = diagnose(read_signals([recording], hand, None), hand, tolerance=0.05, seed=0, sensor_curve=False)
    report = document(result, [], "")
    probability = report["findings"][0]["probability"] if report["findings"] else 0.0
    return name, grade(asdict(case), report), probability


def _rows(graded: list[tuple[str, Grade | None, float]]) -> list[Row]:
    by_name: dict[str, list[tuple[Grade, float]]] = defaultdict(list)
    for name, one, probability in graded:
        by_name[name] += [(one, probability)] if one is not None else []
    return [_row(name, by_name[name]) for name in by_name]


def _row(name: str, graded: list[tuple[Grade, float]]) -> Row:
    grades = [one for one, _ in graded]
    first, joint, place = (sum(bool(getattr(one, what)) for one in grades) for what in ("first", "joint", "place"))
    sure = float(np.median([probability for _, probability in graded])) if graded else 0.0
    return Row(name, len(grades), first, joint, place, sure, tuple(one.called for one in grades if not one.first))


def markdown(rows: list[Row]) -> str:
    """The table as docs/diagnosis.md has it."""
    lines = [
        "| hidden | recordings | first | joint | place | probability | called instead |",
        "|---|---|---|---|---|---|---|",
    ]
    for r in rows:
        if not r.shown:
            lines.append(f"| `{r.effect}` | 0 | | | | | shows nowhere |")
            continue
        instead = ", ".join(f"`{name}`" for name in r.instead)
        lines.append(
            f"| `{r.effect}` | {r.shown} | {r.first} | {r.joint} | {r.place} | {r.probability:.2f} | {instead} |"
        )
    return "\n".join(lines)
