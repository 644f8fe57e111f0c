"""`hand compare` as a user runs it: two models, two recordings, two reports, and what cannot be compared."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from hand_identification.model_file import write_model
from hand_model.description import load_hand
from hand_recording.replay import record_offline
from hand_tool.cli import app
from test.diagnosis.recordings import CONFIG, changed, excitation

FRICTION = {"coulomb_friction.torque_nm": 0.012}


def compare(first: Path, second: Path, out: Path, *options: str) -> Result:
    return CliRunner().invoke(app, ["compare", str(first), str(second), "--out", str(out), *options])


def report(path: Path, effect: str | None, after: float) -> Path:
    """A report with one signal of one joint, and a finding or none."""
    finding: dict[str, Any] = {"joint": "index_distal", "effect": effect, "probability": 0.9, "alternatives": []}
    finding |= {"tied_with": [], "parameters": {}}
    errors = {"rmse_before": 2.0, "rmse_after": after, "noise_floor": 0.01}
    row = {"joint": "index_distal", "signal": "angle", "unit": "deg", "split": "test"} | errors
    content = {"schema": 2, "findings": [finding] if effect else [], "fit": [row], "remainder": [], "not_judged": []}
    path.mkdir()
    (path / "report.json").write_text(json.dumps(content), encoding="utf-8")
    return path


def test_two_models_differ_in_what_was_changed(tmp_path: Path) -> None:
    """Fails when a number that differs is missing, one that is equal is listed, or the two sides are exchanged."""
    write_model(load_hand(CONFIG), {"index_distal": FRICTION}, tmp_path / "b.yaml", "with friction")
    result = compare(CONFIG, tmp_path / "b.yaml", tmp_path / "out", "--json")
    assert result.exit_code == 0, result.output
    (row,) = json.loads(result.output)["differences"]
    assert (row["joint"], row["parameter"], row["a"]) == ("index_distal", "coulomb_friction.torque_nm", 0.0)
    assert row["b"] == pytest.approx(0.012)
    page = (tmp_path / "out" / "compare.html").read_text(encoding="utf-8")
    assert "<h1>1 number of index_distal differs, coulomb_friction.torque_nm: 0 → 0.012 N m</h1>" in page
    same = compare(CONFIG, CONFIG, tmp_path / "same")
    assert same.output.startswith("The models of the joints are equal")


def test_two_recordings_differ_at_the_joint_that_rubs(tmp_path: Path) -> None:
    """Fails when the joint that differs is not named first, or equal set-points are called different."""
    hand = load_hand(CONFIG)
    commands = excitation(np.random.default_rng(2), 4.0, 11)
    for name, truth in (("a", hand), ("b", changed(hand, "ring_distal", coulomb_friction__torque_nm=0.02))):
        for _ in record_offline(truth, commands, tmp_path / f"{name}.mcap", seed=2):
            pass
    result = compare(tmp_path / "a.mcap", tmp_path / "b.mcap", tmp_path / "out", "--json")
    assert result.exit_code == 0, result.output
    rows = json.loads(result.output)["joints"]
    assert rows[0]["joint"] == "ring_distal" and rows[0]["angle_rms"] > 1.0
    assert rows[-1]["angle_rms"] < 0.1 * rows[0]["angle_rms"]
    assert all(row["same_commands"] for row in rows)
    assert (tmp_path / "out" / "compare.html").stat().st_size < 3_000_000


def test_two_reports_show_which_finding_is_gone(tmp_path: Path) -> None:
    """Fails when a finding that only one report has is called common, or an error is left out."""
    before, after = report(tmp_path / "before", "coulomb_friction", 0.03), report(tmp_path / "after", None, 2.0)
    result = compare(before, after, tmp_path / "out", "--json")
    assert result.exit_code == 0, result.output
    content = json.loads(result.output)
    assert content["answer"] == "Only in A: Coulomb friction of index_distal"
    (row,) = content["errors"]
    assert (row["a"]["rmse_after"], row["b"]["rmse_after"]) == (0.03, 2.0)


def test_what_cannot_be_compared_is_one_line(tmp_path: Path) -> None:
    """Fails when files of two kinds, or another JSON, give a traceback or a page."""
    mixed = compare(report(tmp_path / "a", None, 1.0), CONFIG, tmp_path / "out")
    assert mixed.exit_code == 2 and "is a report and" in mixed.output and len(mixed.output.splitlines()) == 1
    other = tmp_path / "other.json"
    other.write_text('{"schema": 1}', encoding="utf-8")
    wrong = compare(other, other, tmp_path / "out")
    assert wrong.exit_code == 2 and "not a report of hand diagnose" in wrong.output
    assert not (tmp_path / "out").exists()
