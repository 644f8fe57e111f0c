"""What each part of the diagnosis earns: a blind trial diagnosed again with one part switched off at a time.

    python -m validation.ablations out/development --key KEY

The recordings are those of a trial whose truth may be looked at (`hand trial make OUT --plant development`). Every row
is made by the same calls of the Python interface, the row with all parts as well. The truth is opened only to grade.
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from hand_diagnosis.api import diagnose, read_recording
from hand_diagnosis.problem import log_likelihood
from hand_diagnosis.search import search_joint
from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit
from validation.results import provenance
from validation.trial.grade import Grade, grade
from validation.trial.run import TOLERANCE, read_plan, recording_of
from validation.trial.score import scores_of
from validation.trial.seal import unseal
from validation.trial.workers import end_with_parent

COMMAND = "python -m validation.ablations FOLDER"
WHOLE, TEXTBOOK = "nothing (all parts)", "learned laws (textbook forms only)"
_SEARCH, _ROUNDS = "hand_diagnosis.search.joint_search", "hand_diagnosis.search.rounds"
Changes = tuple[tuple[str, str, Any], ...]
"""Modules, their attributes, and what stands there instead."""
SHOWN = (
    "place", "joint", "first", "both", "false_alarm", "unknown_found", "unknown_wrong", "clean", "ece", "log_score",
)  # fmt: skip
"""Scores of a row."""


def _textbook(*positional: Any, **named: Any) -> Any:
    """search_joint without learned laws."""
    return search_joint(*positional, **{**named, "laws": False})


def _likelihood(problem: JointProblem, fit: MapFit, optional: Sequence[Sequence[int]] = ()) -> float:
    """Log likelihood of all blocks where the evidence belongs: no prior, and no determinant."""
    return log_likelihood(problem, fit.squares, np.ones_like(problem.validation))


def _as_given(_: Any, done: Sequence[Any]) -> list[Any]:
    return list(done)


def _straight(task: Any, _: Sequence[Any]) -> tuple[Any, list[str]]:
    return task, []


SWITCHES: Mapping[str, Changes] = {
    TEXTBOOK: (("hand_diagnosis.diagnosis.joint", "search_joint", _textbook),),
    "further effects on a joint": (
        (_SEARCH, "SETTINGS", replace(SETTINGS, max_effects=1)),
        (_SEARCH, "two_at_once", lambda *_: []),
    ),
    "two effects at once, and each weighed again": (
        (_SEARCH, "two_at_once", lambda *_: []),
        (_SEARCH, "weighed_again", lambda *_: None),
    ),
    "fits over the whole hand and its pairs": (
        ("hand_diagnosis.diagnosis.hand", "without_unshared", _as_given),
        ("hand_diagnosis.diagnosis.hand", "next_to_models", _as_given),
        ("hand_diagnosis.diagnosis.hand", "with_causes", _as_given),
        ("hand_diagnosis.diagnosis.hand", "with_bends", _straight),
    ),
    "Occam's factor (likelihood only)": (
        (_SEARCH, "log_evidence", _likelihood),
        ("hand_diagnosis.search.hypotheses", "log_evidence", _likelihood),
        ("hand_diagnosis.search.completion", "log_evidence", _likelihood),
    ),
    "comparison below the practical floor": (
        (_ROUNDS, "separated_below_floor", lambda _, __, hypotheses, ___: list(hypotheses)),
    ),
    "starts elsewhere": ((_ROUNDS, "restarted", lambda _, __, rough, ___, ____: rough),),
    "onsets": (("hand_diagnosis.diagnosis.joint", "search_with_onset", lambda *_: None),),
}
"""The parts that are switched off, one a row."""


@contextmanager
def without(part: str) -> Iterator[None]:
    """This process without a part of the diagnosis, a key of SWITCHES, or WHOLE."""
    changes = [(importlib.import_module(module), name, new) for module, name, new in SWITCHES.get(part, ())]
    before = [getattr(module, name) for module, name, _ in changes]
    for module, name, new in changes:
        setattr(module, name, new)
    try:
        yield
    finally:
        for (module, name, _), old in zip(changes, before, strict=True):
            setattr(module, name, old)


def diagnosed(folder: str, planned: Mapping[str, Any], part: str) -> tuple[dict[str, Any], float]:
    """The content of report.json of a case of plan.json without a part, and the CPU time [s] of its diagnosis."""
    model = Path(folder) / planned["model"]
    recording = read_recording(recording_of(Path(folder), planned["model"], planned["number"]), model)
    left_out = [planned["without"]] if planned["without"] else []
    begun = time.process_time()
    with without(part):
        report = diagnose(
            [recording], model, tolerance=planned["tolerance"] or TOLERANCE, without=left_out, sensor_curve=False
        )
    return {key: report.content[key] for key in ("findings", "remainder", "fit")}, time.process_time() - begun


def ablate(
    folder: Path,
    key: bytes,
    parts: Sequence[str],
    *,
    jobs: int,
    progress: Callable[[str], None] = lambda _: None,
) -> dict[str, dict[str, Any]]:
    """Scores and CPU time [s] a recording, by part. Raises ValueError for a wrong key or a broken seal or plan."""
    cases = {case["number"]: case for case in unseal(folder, key)[0]["cases"]}
    plan, found = read_plan(folder), dict[str, dict[str, Any]]()
    for part in parts:  # each with new processes, so that every row pays for loading the compiled loops
        with ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=end_with_parent) as pool:
            answers = list(pool.map(diagnosed, [str(folder)] * len(plan), plan, [part] * len(plan)))
        grades = [grade(cases[planned["number"]], answer) for planned, (answer, _) in zip(plan, answers, strict=True)]
        found[part] = row_of(grades, [seconds for _, seconds in answers])
        progress(part)
    return found


def row_of(grades: Sequence[Grade], seconds: Sequence[float]) -> dict[str, Any]:
    """Scores as those of a trial, and the mean CPU time [s] of a recording."""
    scores = scores_of(grades)
    return {name: scores[name] for name in SHOWN} | {"cpu_s": float(np.mean(seconds)), "recordings": len(seconds)}


def lines_of(result: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """The results for a reader, a line a part."""
    for part, row in result.items():
        shares = (f"{name} {row[name]['value']:.2f}" for name in SHOWN if row[name]["value"] is not None)
        yield f"without {part}: {', '.join(shares)}, CPU {row['cpu_s']:.1f} s a recording"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; exit code 0 done, 2 bad usage or bad input."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.ablations",
        description="Diagnose the recordings of a trial again with one part of the diagnosis switched off at a time.",
        epilog="Example: python -m validation.ablations out/development --key KEY --only onsets",
    )
    parser.add_argument("folder", type=Path, help="folder of the trial")
    parser.add_argument("--key", required=True, help="key of the trial, as hand trial make printed it")
    parser.add_argument("--only", action="append", choices=[WHOLE, *SWITCHES], help="rows to make; may be repeated")
    parser.add_argument("--jobs", type=int, default=2, help="number of processes, 1 to 256")
    parser.add_argument("--out", type=Path, default=Path("out/ablations.json"), help="file of the results")
    options = parser.parse_args(arguments)
    try:
        if not 1 <= options.jobs <= 256:
            raise ValueError(f"--jobs is {options.jobs}; the allowed range is 1 to 256")
        parts = options.only or [WHOLE, *SWITCHES]
        result = ablate(
            options.folder,
            options.key.encode(),
            parts,
            jobs=options.jobs,
            progress=lambda part: print(f"done: {part}", file=sys.stderr),
        )
        options.out.parent.mkdir(parents=True, exist_ok=True)
        data = {**provenance(COMMAND), "ablations": result}
        options.out.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    except (OSError, ValueError) as fault:
        print(f"python -m validation.ablations: {fault}", file=sys.stderr)
        return 2
    print("\n".join(lines_of(result)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
