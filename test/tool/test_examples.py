"""The samples and programs of the folder `examples`, as its README runs them."""

from __future__ import annotations

import json
import runpy
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from hand_diagnosis.pages.page_plots import time_plots
from hand_model.kernel.rows import ROW
from hand_model.yaml_patch import patched_text, read_patch
from hand_tool.cli import app

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def diagnosed(out: Path, *arguments: str) -> dict[str, Any]:
    """report.json of `hand diagnose`."""
    result = CliRunner().invoke(app, ["diagnose", *arguments, "--out", str(out), "--json"])
    assert result.exit_code == 0, result.output
    content: dict[str, Any] = json.loads((out / "report.json").read_text(encoding="utf-8"))
    return content


def test_the_samples_are_those_that_the_program_makes(tmp_path: Path) -> None:
    """Fails when a sample does not come from make_samples.py as it is, or has another clock or unit."""
    program = runpy.run_path(str(EXAMPLES / "make_samples.py"))
    program["main"](tmp_path)
    for name in ("recordings/index_plain.csv", "recordings/index_concealed.csv", "machine/slide.csv"):
        kept, made = (np.loadtxt(folder / name, delimiter=",", skiprows=1) for folder in (EXAMPLES, tmp_path))
        assert kept == pytest.approx(made, abs=0.05), name  # s, bar, degrees, N or mm
        assert (EXAMPLES / name).read_text("utf-8").splitlines()[0] == (tmp_path / name).read_text("utf-8").split()[0]


def test_python_finds_what_is_concealed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when the example of the Python interface does not run, or does not find the effect in the sample.

    Also when the page shows another residual without the effect than the simulation without it gives.
    """
    truth = runpy.run_path(str(EXAMPLES / "make_samples.py"))["CONCEALED"]
    report = runpy.run_path(str(EXAMPLES / "diagnose.py"))["main"](tmp_path)
    (finding,) = report.findings
    assert (finding["joint"], finding["effect"]) == ("index_distal", "coulomb_friction")
    number = finding["parameters"]["coulomb_friction.torque_nm"]
    assert abs(number["value"] - truth["coulomb_friction.torque_nm"]) < 3.0 * number["std"]
    assert capsys.readouterr().out.startswith("explained\n")
    joint = report.diagnosis.joints[0]
    (plot,) = time_plots(joint, 1, 1)
    assert plot.switches == ["Coulomb friction"] and len(plot.notes) == 2
    (variant,) = plot.panels[1].curves[1].variants
    plain = joint.search.with_effects_off("coulomb_friction").residuals[0][1]
    use = joint.search.problem.segments[0].use[1]
    assert variant[: len(plain)][use] == pytest.approx(np.degrees(plain[use]))
    test = variant[len(plain) :][np.isfinite(variant[len(plain) :])]
    assert np.sqrt(np.mean(test**2)) > 10.0 * report.content["fit"][-1]["rmse_after"]  # test data lack it as well
    assert {path.name for path in tmp_path.iterdir()} >= {"report.json", "report.html", "model.yaml"}


def test_the_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a cell raises or keeps outputs of a run, or another effect is found, or one in the plain sample."""
    notebook = json.loads((EXAMPLES / "diagnosis.ipynb").read_text(encoding="utf-8"))
    assert (notebook["nbformat"], len({cell["id"] for cell in notebook["cells"]})) == (4, len(notebook["cells"]))
    shutil.copytree(EXAMPLES / "recordings", tmp_path / "examples" / "recordings")
    (tmp_path / "config").mkdir()
    shutil.copy(EXAMPLES.parent / "config" / "hand.yaml", tmp_path / "config")
    monkeypatch.chdir(tmp_path / "examples")
    names: dict[str, Any] = {}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
    assert [finding["effect"] for finding in names["report"].findings] == ["coulomb_friction"]
    assert (names["agreeing"].verdict, names["agreeing"].findings) == ("agrees", [])
    found = names["report"].findings[0]["parameters"]["coulomb_friction.torque_nm"]["value"]
    assert 0.0 < names["friction"]["value"] < found
    j = names["patched"].joints.index("index_distal")
    assert names["patched"].parameters[ROW["coulomb_friction.torque_nm"], j] == pytest.approx(found, rel=0.1)


def test_the_slide_rubs(tmp_path: Path) -> None:
    """Fails when the machine file does not fit its table, the friction is not found, or the patch is incomplete."""
    folder = EXAMPLES / "machine"
    content = diagnosed(tmp_path, str(folder / "slide.csv"), "--machine", str(folder / "slide.yaml"))
    truth = runpy.run_path(str(EXAMPLES / "make_samples.py"))["SLIDE_FRICTION_N"]
    friction = content["findings"][0]["parameters"]["coulomb_friction.force_n"]
    assert friction["unit"] == "N"
    assert friction["value"] == pytest.approx(truth, rel=0.05)
    text = patched_text(folder / "slide.yaml", read_patch(tmp_path / "patch.yaml"))
    assert yaml.safe_load(text) == yaml.safe_load((tmp_path / "model.yaml").read_text(encoding="utf-8"))
