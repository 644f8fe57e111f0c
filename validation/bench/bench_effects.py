"""Every effect alone at twice its detection limit: is it named first, at the right place and on the right joint?

The recordings are those of `hand trial`: its independent plant, a nominal model that is a few percent off, half a
minute at 100 Hz, one quarter each of a slow triangle, steps, a multisine and a staircase.
"""

from __future__ import annotations

import tempfile
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hand_diagnosis.diagnosis import diagnose
from hand_diagnosis.report import document
from hand_model.description import load_hand
from hand_recording.signal_files import read_signals
from validation.bench.result import figure
from validation.trial.catalogue import KNOWN
from validation.trial.grade import Grade, grade
from validation.trial.make import Case, make_case, write_models
from validation.trial.nominal import Nominal

SEED, ROUNDS, MULTIPLE, MOTION = 17, 4, 2.0, "mixed"
QUICK = ("valve_deadband",)
MODEL = Path(__file__).parents[2] / "config" / "hand.yaml"


@dataclass(frozen=True, slots=True)
class Row:
    """One effect: recordings in which it is visible, and in how many of them name, joint and place are right.

    probability: median of the first finding's.  instead: what was named first where the name is wrong.
    """

    effect: str
    shown: int
    first: int
    joint: int
    place: int
    probability: float
    instead: tuple[str, ...]


def run(quick: bool) -> list[dict[str, Any]]:
    """Results of the bench; quick: fewer effects."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    names = list(QUICK) if quick else [concealed.name for concealed in KNOWN] * ROUNDS
    cases = [Case(k, int(rng.integers(2**31)), "single", [(name, MULTIPLE)], MOTION) for k, name in enumerate(names)]
    with tempfile.TemporaryDirectory() as folder:
        write_models(Nominal(MODEL), Path(folder))
        work = [(case, folder) for case in cases]
        if quick:
            graded = [_judge(item, own_joint_only=True) for item in work]
        else:
            with ProcessPoolExecutor(2) as pool:
                graded = list(pool.map(_judge, work))
    rows = _rows(graded)
    shown = sum(row.shown for row in rows)
    missed = {what: sum(row.shown - getattr(row, what) for row in rows) for what in ("first", "place", "joint")}
    first = figure("effects at twice their limit that are not named first", missed["first"] / shown, 0.0, "share")
    return [
        first | {"rows": [asdict(row) for row in rows]},
        figure("effects at twice their limit in a wrong place", missed["place"] / shown, 0.0, "share"),
        figure("effects at twice their limit on a wrong joint", missed["joint"] / shown, 0.0, "share"),
    ]


def _judge(work: tuple[Case, str], *, own_joint_only: bool = False) -> tuple[str, Grade | None, float]:
    """Effect, grade (None where it is not visible within its usual size), probability of the first finding."""
    case, folder = work
    name = case.effects[0][0]
    case = make_case((case, str(MODEL), folder))
    if not case.truth:
        return name, None, 0.0
    hand = load_hand(Path(folder) / case.model)
    recording = Path(folder) / "recordings" / f"case_{case.number:04d}.mcap"
    joints = (case.truth[0]["joint"],) if own_joint_only else ()
    signals = read_signals([recording], hand, None)
    result = diagnose(signals, hand, tolerance=0.05, seed=0, joints=joints, sensor_curve=False)
    report = document(result, [], "")
    probability = report["findings"][0]["probability"] if report["findings"] else 0.0
    return name, grade(asdict(case), report), probability


def _rows(graded: list[tuple[str, Grade | None, float]]) -> list[Row]:
    by_name: dict[str, list[tuple[Grade, float]]] = defaultdict(list)
    for name, result, probability in graded:
        by_name[name] += [(result, probability)] if result is not None else []
    return [_row(name, by_name[name]) for name in by_name]


def _row(name: str, graded: list[tuple[Grade, float]]) -> Row:
    grades = [result for result, _ in graded]
    first, joint, place = (sum(bool(getattr(g, what)) for g in grades) for what in ("first", "joint", "place"))
    sure = float(np.median([probability for _, probability in graded])) if graded else 0.0
    return Row(
        effect=name,
        shown=len(grades),
        first=first,
        joint=joint,
        place=place,
        probability=sure,
        instead=tuple(g.called for g in grades if not g.first),
    )
