"""`hand new-effect`: what it writes is a working effect of the catalogue, and bad input is refused."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from hand_tool.cli import app
from hand_tool.new_effect import write_effect

ROOT = Path(__file__).resolve().parents[2]
TRIAL = """
from hand_model.effects import CATALOGUE, EFFECTS
from hand_model.kernel.hooks import active_effects, compose
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW, WORK_ROWS
import numpy as np

effect = EFFECTS["tendon_spring"]
names = [other.name for other in CATALOGUE]
assert names[names.index("clock_offset") + 1] == "tendon_spring" and names[-1] == "dropped_frames", "order"
rows = [parameter.key for parameter in JOINT_PARAMETERS]
assert rows[rows.index("clock_offset.share") + 1] == "tendon_spring.stiffness_nm_per_rad", "rows"
w = np.zeros((WORK_ROWS, 1))
for parameter in JOINT_PARAMETERS:
    w[ROW[parameter.key]] = parameter.neutral_si
assert active_effects(w[: len(ROW)]) == (), "neutral"
hooks = compose((effect,))
assert hooks.torque(w, 0, 0.7, 0.1, 1e5, 0.0, (0.0,) * 7) == (0.0, 0.0), "neutral torque"
w[ROW["tendon_spring.stiffness_nm_per_rad"]] = 0.5
assert active_effects(w[: len(ROW)]) == (effect,), "active"
assert hooks.torque(w, 0, 0.8, 0.1, 1e5, 0.0, (0.0,) * 7) == (-0.4, 0.5), "torque"
"""


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A copy of what a new effect needs of the source tree."""
    skipped = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "hand_model", tmp_path / "hand_model", ignore=skipped)
    (tmp_path / "test" / "model").mkdir(parents=True)
    for name in ("test_effects.py", "plain_numbers.py"):
        shutil.copy(ROOT / "test" / "model" / name, tmp_path / "test" / "model")
    shutil.copy(ROOT / "pyproject.toml", tmp_path)  # how tests import each other
    shutil.copytree(ROOT / "docs", tmp_path / "docs", ignore=shutil.ignore_patterns("figures"))
    return tmp_path


def python(tree: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-B", *arguments]
    return subprocess.run(command, cwd=tree, env={"PYTHONPATH": str(tree), "NUMBA_DISABLE_JIT": "1"}, text=True,
                          capture_output=True, check=False)  # fmt: skip


def test_a_new_effect_works_as_written(tree: Path) -> None:
    """Fails when the recipe of docs/effects.md, followed literally, does not end in a working effect."""
    result = CliRunner().invoke(
        app, ["new-effect", "tendon_spring", "--place", "material", "--after", "clock_offset", "--tree", str(tree)]
    )
    assert result.exit_code == 0, result.output
    assert "test/model/test_effects.py" in result.output
    trial = python(tree, "-c", TRIAL)
    assert trial.returncode == 0, trial.stderr
    general = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "test/model/test_effects.py", "-k", "tendon_spring"]
    checked = python(tree, *general)
    assert "compare the equation of tendon_spring with a closed form" in checked.stdout  # the stub cannot pass
    assert "1 failed, 3 passed" in checked.stdout, checked.stdout
    assert python(tree, "-m", "hand_model.tables").returncode == 0
    assert "`tendon_spring.stiffness_nm_per_rad` | 0 … 1" in (tree / "docs" / "model.md").read_text(encoding="utf-8")
    assert "| material | `tendon_spring` |" in (tree / "docs" / "diagnosis.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["Tendon"], "name is 'Tendon'; allowed are lower case letters"),
        (["class"], "name is 'class'; allowed are lower case letters"),
        (["leak"], "name is 'leak'; the catalogue has this effect already"),
        (["numbers"], "name is 'numbers'; numbers.py or a function of this name in test_effects.py is there already"),
        (["tendon", "--place", "motor"], "--place is 'motor'; it must be one of supply, valve"),
        (["tendon", "--after", "nothing"], "--after is 'nothing'; it must be one of supply_droop"),
        (["tendon", "--tree", "/"], "--tree must be the source tree"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(tree: Path, arguments: list[str], message: str) -> None:
    """Fails when bad input is accepted, ends in a traceback, or leaves a file behind."""
    before = {path: path.read_bytes() for path in tree.rglob("*") if path.is_file()}
    place = [] if "--tree" in arguments else ["--tree", str(tree)]
    result = CliRunner().invoke(app, ["new-effect", *arguments, *place])
    assert result.exit_code == 2
    assert result.stderr.startswith("hand new-effect: ")
    assert message in result.stderr
    assert result.stderr.count("\n") == 1
    assert before == {path: path.read_bytes() for path in tree.rglob("*") if path.is_file()}


def test_a_test_file_without_the_mark_is_refused(tree: Path) -> None:
    """Fails when the stub of the check is lost without a word."""
    (tree / "test" / "model" / "test_effects.py").write_text("", encoding="utf-8")
    with pytest.raises(ValueError, match="above which the check would stand"):
        write_effect(tree, "tendon", "joint")
    assert not (tree / "hand_model" / "effects" / "tendon.py").exists()
