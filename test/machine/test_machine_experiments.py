"""The next experiment on another machine than a hand: one that it can perform, and what to do there."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hand_diagnosis import machine_experiments
from hand_diagnosis.experiments import best_experiment, next_experiment
from hand_diagnosis.search import Hypothesis
from hand_identification.free_parameters import effect_free_parameters
from hand_identification.joint_data import joint_problem
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import map_fit
from hand_machine.machine import Machine, load_machine
from hand_model.effects import EFFECTS

TIME = np.arange(0.0, 12.0, 0.01)
SLIDE: dict[str, Any] = {
    "schema": 1,
    "name": "slide",
    "motion": "linear",
    "gain": 2.0,
    "inertia": 0.5,
    "damping": 4.0,
    "stiffness": 40.0,
    "columns": {"time": {"column": "t"}, "input": {"column": "u"}, "position": {"column": "x"}},
}


def machine(folder: Path, kind: str) -> Machine:
    """A slide that its input moves within -3 to 5, that a rig moves within 20 mm at most, or that is released."""
    position = 0.02 * np.sin(0.7 * TIME) if kind == "imposed" else 0.05 + 0.2 * np.sin(0.7 * TIME)
    columns = {"t": TIME, "u": 1.0 + 4.0 * np.sin(0.7 * TIME), "x": position}
    content = SLIDE
    if kind == "imposed":
        content = SLIDE | {"imposed": True, "columns": SLIDE["columns"] | {"force": {"column": "f"}}}
        columns |= {"f": 2.0 * columns["u"] - 40.0 * position - 4.0 * 0.014 * np.cos(0.7 * TIME)}
    if kind == "released":
        columns |= {"u": np.zeros_like(TIME), "x": 0.02 * np.exp(-0.4 * TIME) * np.cos(8.0 * TIME)}
    np.savez(folder / "run.npz", **columns)  # type: ignore[arg-type]
    (folder / "slide.yaml").write_text(json.dumps(content), encoding="utf-8")
    return load_machine(folder / "slide.yaml", [folder / "run.npz"])


def problem_of(axis: Machine) -> JointProblem:
    return joint_problem(axis.signals, axis.model, "axis")


def two_fits(problem: JointProblem) -> list[Hypothesis]:
    """Friction that is dry, and friction that is viscous, each of some size."""
    found = []
    for name in ("coulomb_friction", "viscous_friction"):
        free = effect_free_parameters(EFFECTS[name], problem.nominal)
        fit = map_fit(problem, free, 0.5 * np.ones(len(free)), 1)
        found.append(Hypothesis(EFFECTS[name], fit, 0.0, 1, (0.0, 0.0)))
    return found


@pytest.mark.parametrize(("kind", "names"), [("free", 8), ("imposed", 4), ("released", 1)])
def test_an_experiment_stays_in_the_recorded_range(tmp_path: Path, kind: str, names: int) -> None:
    """Fails when a course leaves the range of input or motion, is one-sided, or a rig is to move faster than it did."""
    axis = machine(tmp_path, kind)
    problem = problem_of(axis)
    able = machine_experiments.performable(problem)
    assert len(able) == names
    segment = problem.segments[0]
    followed = segment.angle_rad if kind == "imposed" else segment.driving_pa
    for name in able:
        course = machine_experiments.course(problem, name)
        assert course.min() >= followed.min() - 1e-9 and course.max() <= followed.max() + 1e-9
        if kind == "free":
            assert course.min() < 0.0 < course.max()
        if kind == "imposed":
            speed = np.abs(np.gradient(course, segment.period_s)).max()
            assert speed <= 1.01 * np.abs(np.gradient(followed, segment.period_s)).max()


def test_what_to_do_is_said_in_the_words_of_the_machine(tmp_path: Path) -> None:
    """Fails when the words are those of a hand, or a range has another unit than that of the machine."""
    texts = {}
    for kind in ("free", "imposed", "released"):
        (tmp_path / kind).mkdir()
        axis = machine(tmp_path / kind, kind)
        problem = problem_of(axis)
        able = machine_experiments.performable(problem)
        texts[kind] = [machine_experiments.how(problem, name, axis.wording) for name in able]
    assert texts["free"][1] == "let the input rise and fall evenly between -3 and 5, three times"
    assert texts["imposed"][0] == "let the position rise and fall evenly between -19.6 mm and 19.6 mm, three times"
    assert texts["released"] == ["hold the axis at 20 mm, release it and wait until it rests; then from -17.1 mm"]
    assert not any("pressure" in text or "joint" in text for each in texts.values() for text in each)


def test_two_kinds_of_friction_are_separated_by_an_experiment_that_is_named(tmp_path: Path) -> None:
    """Fails when two different models differ on no experiment, alike ones differ, or `how` is missing in the report."""
    for kind in ("free", "imposed", "released"):
        (tmp_path / kind).mkdir()
        axis = machine(tmp_path / kind, kind)
        problem = problem_of(axis)
        dry, wet = two_fits(problem)
        able = machine_experiments.performable(problem)
        sigmas = {name: machine_experiments.separation(problem, dry.fit, wet.fit, name) for name in able}
        assert max(sigmas.values()) > 1.0
        assert machine_experiments.separation(problem, dry.fit, dry.fit, next(iter(sigmas))) == 0.0
        best = best_experiment(problem, dry, wet)
        assert best is None or best == (max(sigmas, key=sigmas.__getitem__), max(sigmas.values()))
        joint = SimpleNamespace(joint="axis", search=SimpleNamespace(problem=problem, rounds=[[dry, wet]]))
        left: Any = SimpleNamespace(findings=(), joints=[joint], remainder=[joint], wording=axis.wording)
        asked = next_experiment(left)
        assert asked is not None and asked["name"] in sigmas
        assert asked["how"] == machine_experiments.how(problem, asked["name"], axis.wording)
        assert "command" not in asked
