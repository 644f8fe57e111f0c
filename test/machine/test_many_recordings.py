"""Several recordings of a machine, each diagnosed by itself: the table speaks of its axis, and bad ones are rows."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from hand_diagnosis.fleet import KEY, Job, report_folder, run_job, write_table
from hand_model.effects import EFFECTS
from hand_tool.cli import app
from hand_tool.diagnose import summary_lines

MACHINE = Path(__file__).resolve().parents[2] / "examples" / "machine"
OF_A_HAND = re.compile(r"\b(joints?|hand|pressure|angle|deg|Pa)\b")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first 5 s of the example's slide, and a table without its columns."""
    folder = tmp_path_factory.mktemp("many")
    lines = (MACHINE / "slide.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    (folder / "good.csv").write_text("".join(lines[:1001]), encoding="utf-8")
    (folder / "bad.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    return folder


def test_each_recording_of_a_machine_has_a_report_and_a_row(folder: Path) -> None:
    """Fails when --machine is refused with --each, a bad table ends the run, or the pages speak of a hand's joints.

    Also where the report of one recording does not say how it was made, or its patch gives a number without its unit.
    """
    recordings = [str(folder / f"{name}.csv") for name in ("good", "bad")]
    without = ",".join(name for name in EFFECTS if name != "coulomb_friction")
    options = ["--machine", str(MACHINE / "slide.yaml"), "--each", "--without", without, "--json"]
    result = CliRunner().invoke(app, ["diagnose", *recordings, "--out", str(folder / "out"), *options])
    assert result.exit_code == 0, result.output
    summary = json.loads(result.output.splitlines()[-1])
    assert summary["recordings"] == 2 and summary["verdicts"]["unusable"] == 1
    assert summary["by_joint"] == {"axis: coulomb_friction": 1}
    good = report_folder(folder / "good.csv", folder / "out")
    report = json.loads((good / "report.json").read_text(encoding="utf-8"))
    assert report["words"] == {"whole": "the machine", "axis": "axis"}
    assert report["made"]["seed"] == 0 and report["made"]["duration_s"] > 0.0 and report["made"]["model_sha256"]
    patch = (good / "patch.yaml").read_text(encoding="utf-8")
    for name, unit in (("stiffness", "N/m"), ("damping", "N s/m"), ("inertia", "kg")):
        assert re.search(rf"^  {name}: [\d.]+ # was [\d.]+; ± [\d.e-]+ {unit}$", patch, re.MULTILINE), patch
    assert re.search(r"^    position: \S+ # new; m$", patch, re.MULTILINE)
    assert (good / "model.yaml").is_file()
    page = (folder / "out" / "index.html").read_text(encoding="utf-8")
    body = page.partition("<main>")[2].partition("<section><h2>How this")[0]
    assert "differ from the model" in body and "at the axis, in multiples of the noise" in body
    shown = re.sub(r"<[^>]+>", " ", body)
    assert not OF_A_HAND.search(shown), OF_A_HAND.search(shown)
    content = json.loads(page.partition('id="content">')[2].partition("</script>")[0])
    assert content["joints"] == ["axis"] and not OF_A_HAND.search("; ".join(content["parts"])), content["parts"]
    made = page.partition("How this page was made")[2]
    assert "(sha256 " in made and "<dt>seed</dt><dd>0</dd>" in made


def test_what_concerns_the_whole_machine_is_not_put_on_a_hand(folder: Path, tmp_path: Path) -> None:
    """Fails when the summary, or the sentence of a model that agrees, calls a machine a hand or its axes joints."""
    finding = dict.fromkeys(("rank", "joint", "place", "probability", "statement")) | {"effect": "supply_droop"}
    words = {"whole": "the machine", "axis": "axis"}
    content = {"verdict": "explained", "words": words, "findings": [finding], "remainder": []}
    job = Job(
        recording=str(folder / "good.csv"),
        model=str(MACHINE / "slide.yaml"),
        mapping=None,
        out=str(tmp_path),
        tolerance=0.05,
        seed=0,
        joints=(),
        without=(),
        sensor_curve=None,
        of_machine=True,
    )
    (tmp_path / "report.json").write_text(json.dumps(content), encoding="utf-8")
    (tmp_path / KEY).write_text(job.key, encoding="utf-8")
    assert write_table(run_job(job), tmp_path)["by_joint"] == {"machine: supply_droop": 1}
    resting = [{"joint": "axis", "reason": "it rests"}]
    nothing = content | {
        "verdict": "unusable",
        "findings": [],
        "fit": [],
        "not_judged": resting,
        "next_experiment": None,
    }
    lines = summary_lines(content | nothing | {"not_claimable": [], "data_check": []}, tmp_path, ask=False)
    assert lines[:2] == ["verdict: unusable", "Nothing could be diagnosed; 1 of 1 axes not diagnosed"]
