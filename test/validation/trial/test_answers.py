"""A trial as a task for other methods: what is handed out, and that answers are graded like reports."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from validation.trial.answers import export, read_answers
from validation.trial.score import score
from validation.trial.seal import COMMITMENT, SEALED, new_key, seal

FRICTION = {"joint": "index_distal", "place": "joint", "effect": "coulomb_friction", "probability": 0.8}


def trial(folder: Path) -> bytes:
    """A trial of two cases without recordings worth reading: friction, and nothing."""
    (folder / "recordings").mkdir(parents=True)
    truth = {
        "effect": "coulomb_friction", "place": "joint", "joint": "index_distal", "multiple": 2.0, "size": 1.0,
        "group": ["coulomb_friction"], "number": None,
    }  # fmt: skip
    base: dict[str, Any] = {"motion": "steps", "without": "", "unplaced": [], "effects": []}
    cases = [
        base | {"number": 0, "kind": "single", "truth": [truth], "labels": ["jitter"], "families": ["dry"]},
        base | {"number": 1, "kind": "null", "truth": []},
    ]
    plan = [{"number": k, "model": "model.yaml", "without": "", "tolerance": 0.0} for k in range(2)]
    (folder / "plan.json").write_text(json.dumps(plan), encoding="utf-8")
    (folder / "model.yaml").write_text("schema: 1\n", encoding="utf-8")
    for k in range(2):
        (folder / "recordings" / f"case_{k:04d}.mcap").write_bytes(b"recorded")
    key = new_key()
    seal({"seed": 1, "cases": cases}, folder, key)
    return key


def test_what_is_handed_out_holds_no_truth(tmp_path: Path) -> None:
    """Fails when the sealed truth or a report is handed out, or a file that a method needs is not."""
    trial(tmp_path / "trial")
    (tmp_path / "trial" / "reports").mkdir()
    assert export(tmp_path / "trial", tmp_path / "task") == 2
    names = sorted(str(path.relative_to(tmp_path / "task")) for path in (tmp_path / "task").rglob("*.*"))
    assert names == [COMMITMENT, "model.yaml", "plan.json", "recordings/case_0000.mcap", "recordings/case_0001.mcap"]
    assert SEALED not in names


def test_answers_are_graded_like_reports(tmp_path: Path) -> None:
    """Fails when a right answer counts as wrong, a false alarm as right, or the scores lack a condition or a family."""
    key = trial(tmp_path)
    answers = tmp_path / "answers.json"
    for findings, alarms in (([], 0.0), ([FRICTION], 1.0)):
        given = [{"number": 0, "findings": [FRICTION], "remainder": []}]
        answers.write_text(json.dumps([*given, {"number": 1, "findings": findings, "remainder": []}]), encoding="utf-8")
        result = score(tmp_path, key, read_answers(answers))
        scores = {name: figure["value"] for name, figure in result["scores"].items()}
        assert (scores["first"], scores["joint"], scores["false_alarm"]) == (1.0, 1.0, alarms)
        assert result["by_group"]["condition: jitter"]["first"]["value"] == 1.0
        assert result["by_group"]["family: dry"]["first"]["count"] == 1
    assert scores["brier"] == pytest.approx(0.04 / 2 + 0.64 / 2)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("{", "is not JSON"),
        ("{}", "must be a list"),
        ('[{"number": 0}]', "answer 0 must be a mapping of"),
        ('[{"number": 0, "findings": {}, "remainder": []}]', "findings of answer 0 must be a list"),
        (json.dumps([{"number": 0, "findings": [{"joint": "a"}], "remainder": []}]), "must be a mapping of joint"),
        (json.dumps([{"number": 0, "findings": [FRICTION | {"probability": 2}], "remainder": []}]), "must be 0 to 1"),
        (json.dumps([{"number": 0, "findings": [FRICTION | {"place": 3}], "remainder": []}]), "place in findings"),
        (json.dumps([{"number": 0, "findings": [], "remainder": []}] * 2), "case 0 is answered twice"),
    ],
)
def test_a_bad_answer_is_one_line(text: str, line: str, tmp_path: Path) -> None:
    """Fails when a bad answer passes, or ends in anything but one line that says where it is."""
    path = tmp_path / "answers.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=line) as refused:
        read_answers(path)
    assert "\n" not in str(refused.value)


def test_a_missing_answer_is_one_line(tmp_path: Path) -> None:
    """Fails when a case without an answer counts as answered."""
    key = trial(tmp_path)
    with pytest.raises(ValueError, match="case 0 has no answer"):
        score(tmp_path, key, {})
