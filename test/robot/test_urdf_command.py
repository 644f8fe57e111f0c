"""`hand urdf`: its formats and its bad input."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from hand_tool.cli import app, run

CONFIG = Path(__file__).resolve().parents[2] / "config" / "hand.yaml"


def hand(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["urdf", "--model", str(CONFIG), *arguments])


@pytest.mark.parametrize(
    ("form", "beginning"), [("urdf", "<robot"), ("xacro", "<robot"), ("srdf", "<robot"), ("mjcf", "<mujoco")]
)
def test_every_format_goes_to_standard_output_and_to_a_file(form: str, beginning: str, tmp_path: Path) -> None:
    """Broken by notes between the lines of the model, or a file that differs from standard output."""
    printed = hand("--format", form)
    assert printed.exit_code == 0
    assert printed.stdout.splitlines()[2].startswith(beginning)
    out = tmp_path / "model.xml"
    assert hand("--format", form, "--out", str(out)).exit_code == 0
    assert out.read_text(encoding="utf-8") == printed.stdout


BAD = {
    "prefix": (("--prefix", "left hand"), "--prefix is 'left hand'; it must consist of letters, digits"),
    "mount": (("--mount", "tool<0>"), "--mount is 'tool<0>'"),
    "namespace": (("--namespace", "a b"), "--namespace is 'a b'"),
    "format": (("--format", "sdf"), "sdf"),
    "moveit": (("--format", "moveit"), "--format moveit writes several files; --out must name a new folder"),
    "hands": (("--format", "moveit", "--hands", "left,,right", "--out", "x"), "--hands is 'left,,right'; it must be"),
    "hands of urdf": (("--hands", "left,right"), "--hands and --robot need --format srdf or moveit"),
    "robot": (("--format", "srdf", "--robot", "two hands"), "--robot is 'two hands'"),
    "control": (("--ros2-control", "gazebo"), "gazebo"),
    "grasps": (("--format", "srdf", "--grasps", "none.yaml"), "none.yaml does not exist"),
}


@pytest.mark.parametrize("case", BAD.values(), ids=BAD)
def test_bad_usage_is_one_line(case: tuple[tuple[str, ...], str]) -> None:
    """Broken by a traceback, an exit code other than 2, or a name that XML or TF does not accept."""
    arguments, part = case
    result = CliRunner().invoke(app, ["urdf", "--model", str(CONFIG), *arguments])
    assert result.exit_code == 2
    assert part in result.output
    assert "Traceback" not in result.output
    assert run(["urdf", "--format", "sdf"]) == 2


def test_a_model_without_geometry_and_an_existing_file_are_refused(tmp_path: Path) -> None:
    """Broken by a model that is made up, or a file that is overwritten."""
    text = CONFIG.read_text(encoding="utf-8")
    plain = tmp_path / "hand.yaml"
    plain.write_text(text[: text.index("geometry:")], encoding="utf-8")
    result = CliRunner().invoke(app, ["urdf", "--model", str(plain)])
    assert result.exit_code == 2 and "geometry is missing" in result.output
    result = hand("--out", str(plain))
    assert result.exit_code == 2 and "exists already; models are never overwritten" in result.output
