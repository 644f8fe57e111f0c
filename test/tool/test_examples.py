"""The samples and programs of the folder `examples`, as its README runs them."""

from __future__ import annotations

import hashlib
import json
import runpy
import shlex
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from typer.testing import CliRunner

from hand_diagnosis.pages.page_plots import time_plots
from hand_model.description import load_hand
from hand_model.kernel.rows import ROW
from hand_model.yaml_patch import patched_text, read_patch
from hand_recording.hand_signals import hand_signals
from hand_recording.loader import load_recording
from hand_recording.version import version
from hand_studio.replay import window_of
from hand_tool.cli import app

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
TOOL = (sys.executable, "-m", "hand_tool")


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
    for name in ("recordings/index_plain.mcap", "recordings/index_concealed.mcap"):
        bags = [load_recording(folder / name) for folder in (EXAMPLES, tmp_path)]
        assert set(bags[0].topics) == set(bags[1].topics)
        angles = [bag["joint_states"]["position"] for bag in bags]
        assert angles[0] == pytest.approx(angles[1], abs=1e-3), name
        assert (EXAMPLES / name).stat().st_size < 300_000


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
    """Fails when a cell raises or keeps outputs of a run, or another effect is found, or one in the plain sample.

    Also when the model found is not nearer to the measured curve, or the report does not say how it was made.
    """
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
    measured, nominal, better = (line.get_ydata() for line in names["axis"].lines)
    errors = [float(np.nanmean((measured - curve) ** 2)) for curve in (nominal, better)]
    assert np.isfinite(nominal).any() and errors[1] < 0.1 * errors[0]
    names["plt"].close(names["figure"])
    written = json.loads((tmp_path / "out" / "notebook" / "report.json").read_text(encoding="utf-8"))
    digest = hashlib.sha256((tmp_path / "config" / "hand.yaml").read_bytes()).hexdigest()
    assert written["made"]["model_sha256"] == digest and written["made"]["version"] == version()
    assert written["made"]["date"].startswith("20")
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


def commands() -> list[list[str]]:
    """The words of each command of the README."""
    lines = (EXAMPLES / "README.md").read_text(encoding="utf-8").splitlines()
    return [shlex.split(line) for line in lines if line.startswith("    ")]


def effects(folder: Path) -> list[tuple[str, str]]:
    """Joint and effect of each finding of a diagnosis."""
    content = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    return [(finding["joint"], finding["effect"]) for finding in content["findings"]]


def test_a_recording_has_what_the_3_d_views_and_the_studio_need() -> None:
    """Fails when a sample has no robot_description, or not one angle, pressure and set-point of every joint."""
    recording = EXAMPLES / "recordings" / "index_concealed.mcap"
    with recording.open("rb") as stream:
        (robot,) = (found[2].data for found in make_reader(stream).iter_messages(["/hand/robot_description"]))
    assert robot[8:].startswith(b"<?xml") and b"<robot name=" in robot
    hand = load_hand(EXAMPLES.parent / "config" / "hand.yaml")
    window = window_of(hand_signals(load_recording(recording), hand), hand)
    assert np.isfinite(window.angle_rad).all() and np.isfinite(window.pressure_pa).all()
    assert np.ptp(window.set_point_pa, axis=0).max() > 1e5


@pytest.mark.long
def test_every_command_of_the_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a command of the README fails, or its diagnosis has another answer than the README says."""
    (tmp_path / "examples").symlink_to(EXAMPLES)
    (tmp_path / "config").symlink_to(EXAMPLES.parent / "config")
    monkeypatch.chdir(tmp_path)
    for program, *words in commands():
        if "studio" in words:
            shown = subprocess.Popen([*TOOL, *words, "--no-browser", "--json"], stdout=subprocess.PIPE, text=True)
            assert shown.stdout is not None and json.loads(shown.stdout.readline())["url"]
            shown.send_signal(signal.SIGINT)
            assert shown.wait(timeout=20.0) == 0
        else:
            command = TOOL if program == "hand" else (sys.executable,)
            subprocess.run([*command, *words], check=True, stdout=subprocess.DEVNULL)
    rubs = [("index_distal", "coulomb_friction")]
    names = ("plain", "concealed", "recorded", "example", "triangle")
    found = {name: effects(tmp_path / "out" / name) for name in names}
    assert found == {"plain": [], "concealed": rubs, "recorded": rubs, "example": rubs, "triangle": []}
    assert "Only in B: Coulomb friction" in (tmp_path / "out" / "compared" / "compare.html").read_text(encoding="utf-8")
