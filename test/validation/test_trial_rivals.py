"""Rivals on the recordings of a trial: their split, their errors, the forest, and bad input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from validation.machines.parts import Part
from validation.tables import rivals_table
from validation.trial_rivals import NOTHING, Forest, JointData, fit_row, label, main, name_row, ratios_of

SEED = 4


def joint_data(friction: float, name: str = "a") -> JointData:
    """A joint whose residual is a constant that changes its sign with the direction, and white noise of 1e-3 rad."""
    rng, time = np.random.default_rng(SEED), np.arange(1500) * 0.01
    x, v = np.sin(2.0 * time), 2.0 * np.cos(2.0 * time)
    sign = np.tanh(v / 0.02)
    left = friction * sign + 1e-3 * rng.standard_normal(len(time))
    states = np.column_stack([x, v, 1e5 * (1.0 + x), sign])
    part = Part(0.01, states, np.gradient(v, 0.01), x + left, left, np.ones(len(time), dtype=bool))
    return JointData(name, part.cut(0, 1200), part.cut(1200, 1500), 1e-3, np.array([friction, 1.0]))


def test_friction_is_taken_away_by_the_rivals_that_can_and_by_no_other() -> None:
    """Fails when a rival is fitted to other data than it is tested on, or the nominal error loses what is lacking."""
    found = ratios_of(joint_data(0.02))
    assert 15.0 < found["nominal numbers fitted again"] < 21.0
    assert all(found[name] < 1.25 for name in ("best of six", "SINDy", "Gaussian process")), found
    assert found["NARX"] < 5.0
    assert ratios_of(joint_data(0.0))["nominal numbers fitted again"] == pytest.approx(1.0, abs=0.15)


def test_the_forest_names_what_it_learned_and_nothing_on_a_plain_joint() -> None:
    """Fails when classes, joints or places are confused, or a plain joint gets a finding."""
    truth = [{"effect": "leak", "place": "valve", "joint": "a"}]
    rows = np.array([[0.02 + 1e-4 * k, 1.0] for k in range(8)] + [[1e-4 * k, 1.0] for k in range(8)])
    forest = Forest(rows, ["leak"] * 8 + [NOTHING] * 8, truth)
    answer = forest.answer([joint_data(0.0, "b"), joint_data(0.02)])
    assert [(each["effect"], each["place"], each["joint"]) for each in answer["findings"]] == [("leak", "valve", "a")]
    assert answer["remainder"] == []
    assert label(truth, "a") == "leak" and label(truth, "b") == NOTHING
    assert label([{"effect": "x", "place": "unknown", "joint": "a"}], "a") == "unknown"
    with pytest.raises(ValueError, match="fewer than two classes"):
        Forest(rows, ["leak"] * 16, truth)


def test_the_table_says_who_gives_no_names() -> None:
    """Fails when a row is lost, or a share is shown for a method that gives no names."""
    results = {
        "recordings": 1,
        "trained_on": 2,
        "fits": {"SINDy": fit_row([1.0, 2.0])},
        "names": {"forest": name_row([])},
    }
    entry = {"command": "c", "date": "d", "commit": "e", "machine": "", "results": results}
    lines = rivals_table(entry).splitlines()
    assert lines[2] == "| SINDy | 1.5 | 50% of 2 | gives no names |  |  |  |"
    assert lines[3].startswith("| forest | predicts nothing |")


def test_bad_input_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when bad input gives a traceback, or a forest may learn from the trial itself."""
    folder = str(tmp_path)
    assert main([folder, "--key", "k", "--train", folder, "--train-key", "k"]) == 2
    assert main([folder, "--key", "k", "--train", "x", "--train", "y", "--train-key", "k"]) == 2
    assert main([folder, "--key", "k", "--train", "x", "--train-key", "k"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3
    assert "the trial itself" in lines[0] and "2 --train but 1 --train-key" in lines[1]
