"""`hand compare` as a user runs it: two models, two recordings, two reports, and what cannot be compared."""

from __future__ import annotations

import hashlib
import json
import re
from html import unescape
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

EXAMPLES = CONFIG.parent.parent / "examples" / "machine"
SLIDE, TABLE = EXAMPLES / "slide.yaml", EXAMPLES / "slide.csv"
RESTING = 2 * [{"joint": "axis", "reason": "moved too little"}]
FRICTION = {"coulomb_friction.torque_nm": 0.012}


def compare(first: Path, second: Path, out: Path, *options: str) -> Result:
    return CliRunner().invoke(app, ["compare", str(first), str(second), "--out", str(out), *options])


def report(path: Path, effect: str | None, after: float, **more: Any) -> Path:
    """A report with one signal of one joint, and a finding or none. more: further fields."""
    finding: dict[str, Any] = {"joint": "index_distal", "effect": effect, "probability": 0.9, "alternatives": []}
    finding |= {"tied_with": [], "parameters": {}}
    errors = {"rmse_before": 2.0, "rmse_after": after, "noise_floor": 0.01}
    row = {"joint": "index_distal", "signal": "angle", "unit": "deg", "split": "test"} | errors
    content = {
        "schema": 2,
        "model": "hand.yaml",
        "findings": [finding] if effect else [],
        "fit": [row],
        "remainder": [],
        "not_judged": [],
    }
    path.mkdir()
    (path / "report.json").write_text(json.dumps(content | more), encoding="utf-8")
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
    moved = json.loads(result.output)["simulated"]["joints"]
    assert moved[0]["joint"] == "index_distal" and moved[0]["angle_rms"] > 1.0 and moved[-1]["angle_rms"] < 0.05
    assert "index_distal: angle [deg]" in page and "ring_distal: angle [deg]" not in page
    same = compare(CONFIG, CONFIG, tmp_path / "same")
    digest = hashlib.sha256(CONFIG.read_bytes()).hexdigest()
    assert same.stderr.splitlines() == 2 * [f"model: {CONFIG} (sha256 {digest[:8]})"]
    assert same.output.startswith("The models are equal") and "simulated" not in same.output


def test_two_models_differ_outside_their_joints(tmp_path: Path) -> None:
    """Fails when files that differ only in a limit and the name are called equal, or a text has a change in %."""
    text = CONFIG.read_text(encoding="utf-8")
    other = text.replace("max_torque_nm: 0.6", "max_torque_nm: 0.5").replace("name: fluidic_hand", "name: other")
    (tmp_path / "b.yaml").write_text(other, encoding="utf-8")
    result = compare(CONFIG, tmp_path / "b.yaml", tmp_path / "out", "--json")
    assert result.exit_code == 0, result.output
    content = json.loads(result.output)
    assert content["answer"].startswith(
        "12 entries of 12 parts differ, among them name of the hand: fluidic_hand → other"
    )
    assert {row["parameter"] for row in content["differences"]} == {"name", "limits.max_torque_nm"}
    page = unescape((tmp_path / "out" / "compare.html").read_text(encoding="utf-8"))
    assert "no angle differs by 0.05 degree or more" in page and "<td>other</td>" in page
    assert page.count("<tr>") == 3 and "<td>all 11</td>" in page


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
    page = (tmp_path / "out" / "compare.html").read_text(encoding="utf-8")
    assert page.count("A - B [deg]") == page.count("A - B [kPa]") == len(rows)


def test_two_reports_show_which_finding_is_gone(tmp_path: Path) -> None:
    """Fails when a finding that only one report has is called common, or an error is left out."""
    before, after = report(tmp_path / "before", "coulomb_friction", 0.03), report(tmp_path / "after", None, 2.0)
    result = compare(before, after, tmp_path / "out", "--json")
    assert result.exit_code == 0, result.output
    content = json.loads(result.output)
    assert content["answer"] == "Only in A: Coulomb friction of index_distal"
    (row,) = content["errors"]
    assert (row["a"]["rmse_after"], row["b"]["rmse_after"]) == (0.03, 2.0)
    page = (tmp_path / "out" / "compare.html").read_text(encoding="utf-8")
    assert page.count('class="track"') == 1 and page.count('<i class="end after') == 2
    noise = row["a"]["noise_floor"]
    wanted = [row["a"][key] / noise for key in ("rmse_before", "rmse_after")]
    shown = re.search(r'title="A: (\S+) → (\S+); B:', page)
    assert shown and [float(shown[1]), float(shown[2])] == pytest.approx(wanted, rel=0.05)


def made(page: Path) -> dict[str, str]:
    """What a page says about how it was made, by name."""
    text = unescape(page.read_text(encoding="utf-8"))
    return dict(re.findall(r"<dt>(.*?)</dt><dd>(.*?)</dd>", text))


def test_two_reports_of_a_machine_have_its_words(tmp_path: Path) -> None:
    """Fails when the page of a machine's reports speaks of a joint or a hand, or leaves out the models with hashes."""
    words = {"words": {"whole": "the machine", "axis": "axis"}, "made": {"model_sha256": 64 * "a"}}
    before, after = (report(tmp_path / name, None, 2.0, not_judged=RESTING, **words) for name in "ab")
    assert compare(before, after, tmp_path / "out").exit_code == 0
    page = (tmp_path / "out" / "compare.html").read_text(encoding="utf-8")
    assert '<th scope="col">axis</th>' in page and "2 of 3 axes not diagnosed" in page
    assert not re.search(r"\b(joint|the hand)\b", page.partition("<main>")[2].partition("<dl")[0])
    assert made(tmp_path / "out" / "compare.html")["model"] == f"hand.yaml (sha256 {16 * 'a'})"


def test_two_models_of_a_machine_differ_in_its_units(tmp_path: Path) -> None:
    """Fails when a number of a machine file is not compared, has a unit of a hand, or an effect is not called new."""
    stiffer = SLIDE.read_text(encoding="utf-8").replace("stiffness: 40.0", "stiffness: 50.0")
    assert stiffer != SLIDE.read_text(encoding="utf-8")
    (tmp_path / "b.yaml").write_text(stiffer + "effects: {coulomb_friction.force_n: 0.25}\n", encoding="utf-8")
    result = compare(SLIDE, tmp_path / "b.yaml", tmp_path / "out", "--json")
    assert result.exit_code == 0, result.output
    content = json.loads(result.output)
    friction, stiffness = content["differences"]
    fields = ("parameter", "a", "b", "unit", "relative_change")
    assert [friction[name] for name in fields] == ["coulomb_friction.force_n", None, 0.25, "N", None]
    assert [stiffness[name] for name in fields] == ["stiffness", 40.0, 50.0, "N/m", 0.25]
    answer = "2 numbers of the axis differ, most coulomb_friction.force_n: none → 0.25 N"
    assert content["answer"] == answer
    assert '<th scope="col">axis</th>' in (tmp_path / "out" / "compare.html").read_text(encoding="utf-8")
    rows = made(tmp_path / "out" / "compare.html")
    digests = [hashlib.sha256(path.read_bytes()).hexdigest()[:16] for path in (SLIDE, tmp_path / "b.yaml")]
    assert all(digest in rows["model"] for digest in digests) and rows["duration"].endswith(" s")
    mixed = compare(SLIDE, CONFIG, tmp_path / "out")
    assert mixed.exit_code == 2 and "describes a machine and" in mixed.output and len(mixed.output.splitlines()) == 1
    turning = tmp_path / "turning.yaml"
    turning.write_text(SLIDE.read_text(encoding="utf-8").replace("motion: linear", "motion: rotary"), encoding="utf-8")
    other = compare(SLIDE, turning, tmp_path / "out")
    assert other.exit_code == 2 and "must have the same `motion`" in other.output


def test_two_recordings_of_a_machine_differ_in_its_units(tmp_path: Path) -> None:
    """Fails when --machine is ignored, a shift of 3 mm is not 3 mm, or the page says pressure, angle or joint."""
    header, *lines = TABLE.read_text(encoding="utf-8").splitlines()
    column = header.split(",").index("x_mm")
    rows = [line.split(",") for line in lines]
    for row in rows:
        row[column] = f"{float(row[column]) + 3.0:.6g}"
    (tmp_path / "b.csv").write_text("\n".join([header, *map(",".join, rows)]) + "\n", encoding="utf-8")
    result = compare(TABLE, tmp_path / "b.csv", tmp_path / "out", "--machine", str(SLIDE), "--json")
    assert result.exit_code == 0, result.output
    content = json.loads(result.output)
    (row,) = content["joints"]
    assert row["position_rms"] == pytest.approx(3.0, rel=1e-3) and row["position_unit"] == "mm"
    assert row["input_rms"] == 0.0 and row["same_commands"]
    assert content["answer"] == "axis: the position differs by 3 mm RMS"
    page = (tmp_path / "out" / "compare.html").read_text(encoding="utf-8")
    body = page.partition("<main>")[2].partition("<dl")[0]
    assert "axis: position [mm]" in body and '<th scope="col">inputs</th>' in body
    assert not re.search(r"\b(pressure|angle|joint|deg|Pa|kPa|set-points?)\b", body)
    rows_made = made(tmp_path / "out" / "compare.html")
    assert rows_made["model"].startswith(str(SLIDE)) and "(sha256 " in rows_made["model"]
    refused = compare(TABLE, TABLE, tmp_path / "no", "--machine", str(SLIDE), "--model", str(CONFIG))
    assert refused.exit_code == 2 and "cannot be used with --machine" in refused.output


def test_what_cannot_be_compared_is_one_line(tmp_path: Path) -> None:
    """Fails when files of two kinds, or another JSON, give a traceback or a page."""
    mixed = compare(report(tmp_path / "a", None, 1.0), CONFIG, tmp_path / "out")
    assert mixed.exit_code == 2 and "is a report and" in mixed.output and len(mixed.output.splitlines()) == 1
    other = tmp_path / "other.json"
    other.write_text('{"schema": 1}', encoding="utf-8")
    wrong = compare(other, other, tmp_path / "out")
    assert wrong.exit_code == 2 and "not a report of hand diagnose" in wrong.output
    assert not (tmp_path / "out").exists()
