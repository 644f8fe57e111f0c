"""A trial as a task for any method: recordings and models without the truth, and answers that are graded like reports.

answers.json is a list with one entry a case: {"number": 0, "findings": [...], "remainder": [...]}. A finding has the
keys joint (null: the whole hand), place, effect and probability; an entry of the remainder has joint and probability.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

from validation.trial.run import read_plan, recording_of

FINDING = {"joint": str, "place": str, "effect": str, "probability": float}
LEFT = {"joint": str, "probability": float}
ANSWER = {"number", "findings", "remainder"}
PUBLIC = ("commitment.txt", "plan.json")


def export(folder: Path, out: Path) -> int:
    """Copy what another method may see of a trial to a new folder; returns the number of recordings.

    Raises ValueError for a broken plan, FileNotFoundError for a missing recording.
    """
    plan = read_plan(folder)
    out.mkdir(parents=True, exist_ok=True)
    (out / "recordings").mkdir()
    for name in (*PUBLIC, *sorted({case["model"] for case in plan})):
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(folder / name, out / name)
    for case in plan:
        recording = recording_of(folder, case["model"], case["number"])
        shutil.copyfile(recording, out / "recordings" / recording.name)
    return len(plan)


def read_answers(path: Path) -> dict[int, dict[str, Any]]:
    """The answers by the number of their case, as reports that can be graded. Raises ValueError, one line."""
    try:
        given = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is not JSON: {' '.join(str(error).split())}") from None
    if not isinstance(given, list):
        raise ValueError(f"{path} must be a list with one answer a case")
    answers: dict[int, dict[str, Any]] = {}
    for place, answer in enumerate(given):
        if not isinstance(answer, dict) or answer.keys() != ANSWER or type(answer["number"]) is not int:
            raise ValueError(f"{path}: answer {place} must be a mapping of {', '.join(sorted(ANSWER))}")
        if answer["number"] in answers:
            raise ValueError(f"{path}: case {answer['number']} is answered twice")
        findings, left = (
            [_checked(path, place, key, entry, wanted) for entry in _list(path, place, answer, key)]
            for key, wanted in (("findings", FINDING), ("remainder", LEFT))
        )
        report = {"findings": [{"alternatives": [], "parameters": {}, **entry} for entry in findings]}
        answers[answer["number"]] = {**report, "remainder": left, "fit": []}
    return answers


def _list(path: Path, place: int, answer: dict[str, Any], key: str) -> list[Any]:
    if not isinstance(answer[key], list):
        raise ValueError(f"{path}: {key} of answer {place} must be a list")
    return list(answer[key])


def _checked(path: Path, place: int, key: str, entry: Any, wanted: dict[str, type]) -> dict[str, Any]:
    if not isinstance(entry, dict) or entry.keys() != wanted.keys():
        raise ValueError(f"{path}: each of {key} of answer {place} must be a mapping of {', '.join(wanted)}")
    for name in wanted:
        value = entry[name]
        if name == "probability":
            if type(value) not in {int, float} or not 0.0 <= value <= 1.0:
                raise ValueError(f"{path}: probability in {key} of answer {place} must be 0 to 1")
        elif not (isinstance(value, str) or (name == "joint" and value is None)):
            raise ValueError(f"{path}: {name} in {key} of answer {place} must be a text")
    return entry
