"""Effects of drives and of friction by direction on an independent plant: the right name first, with its numbers."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hand_diagnosis.diagnosis import Diagnosis, diagnose
from hand_diagnosis.found_machine import write_machine_model
from hand_diagnosis.prediction import predict
from hand_identification.joint_problem import STAGES
from hand_machine.description import load_description
from hand_machine.machine import Machine, load_machine
from hand_machine.reading import read_machine
from hand_model.effects import CATALOGUE
from hand_model.yaml_loader import DescriptionError

INERTIA, DAMPING, STIFFNESS = 0.02, 0.3, 4.0
TRIED = {
    *("coulomb_friction", "viscous_friction", "directional_friction", "constant_load", "stiffening", "gravity"),
    *("drive_lag", "drive_saturation", "command_delay", "cogging", "added_inertia"),
    *("gear_friction", "spring", "drive_gain", "drive_elasticity"),
}
OTHERS = [effect.name for effect in CATALOGUE if effect.name not in TRIED]
NOISE_RAD = 2e-4
AXIS: dict[str, Any] = {
    "schema": 1,
    "name": "axis",
    "motion": "rotary",
    "gain": {"value": 1.0, "exact": True},
    "stiffness": STIFFNESS,
    "damping": DAMPING,
    "inertia": INERTIA,
    "has": ["motor"],
    "columns": {"time": {"column": "t"}, "input": {"column": "u"}, "position": {"column": "x"}},
}
Drive = Callable[[float, float, float, float], tuple[float, float]]
"""(input now, input 30 ms ago, position, speed) -> torque of the drive before its lag, other torque [N m]."""


def friction(_now: float, _before: float, _x: float, v: float) -> tuple[float, float]:
    return _now, -0.25 * max(v, 0.0) - 0.06 * 0.5 * (1.0 + float(np.tanh(v / 0.01)))


PLANTS: dict[str, Drive] = {
    "none": lambda now, before, x, v: (now, 0.0),
    "command_delay": lambda now, before, x, v: (before, 0.0),
    "drive_lag": lambda now, before, x, v: (now, 0.0),
    "drive_saturation": lambda now, before, x, v: (min(max(now, -1.1), 1.1), 0.0),
    "speed": lambda now, before, x, v: (min(max(now, -1.6 - 0.45 * min(v, 0.0)), 1.6 - 0.45 * max(v, 0.0)), 0.0),
    "position": lambda now, before, x, v: (min(max(30.0 * (0.4 * now - x) - v, -4.0), 4.0), 0.0),
    "cogging": lambda now, before, x, v: (now, 0.15 * float(np.sin(2.0 * np.pi * x / np.radians(6.0) + 0.7))),
    "directional_friction": friction,
}


def machine(folder: Path, plant: str, seed: int, *, seconds: float = 16.0) -> Machine:
    """The machine and a recording of it at 200 Hz, by an integrator of scipy."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    time, knots = np.arange(0.0, seconds, 0.005), np.arange(0.0, seconds + 0.5, 0.5)
    command = np.interp(time, knots, rng.uniform(-1.6, 1.6, len(knots))) + 0.5 * np.sign(np.sin(2.2 * time))

    def rates(t: float, y: np.ndarray) -> list[float]:
        now, before = float(np.interp(t, time, command)), float(np.interp(t - 0.03, time, command))
        asked, other = PLANTS[plant](now, before, y[0], y[1])
        driving = float(y[2]) if plant == "drive_lag" else asked
        return [y[1], (driving + other - DAMPING * y[1] - STIFFNESS * y[0]) / INERTIA, (asked - y[2]) / 0.06]

    found = solve_ivp(rates, (0.0, time[-1]), [0.0, 0.0, command[0]], "LSODA", time, max_step=0.01, rtol=1e-7)
    content = AXIS
    if plant == "position":
        command = 0.4 * command
        content = {key: value for key, value in AXIS.items() if key != "gain"}
        content |= {"controller": {"stiffness": 30.0, "damping": 1.0}}
    folder.mkdir(exist_ok=True)
    np.savez(folder / "run.npz", t=time, u=command, x=found.y[0] + NOISE_RAD * rng.standard_normal(len(time)))
    (folder / "axis.yaml").write_text(json.dumps(content), encoding="utf-8")
    return load_machine(folder / "axis.yaml", [folder / "run.npz"], to_fit=True)


def diagnosed(axis: Machine) -> Diagnosis:
    return diagnose(axis.signals, axis.model, tolerance=0.05, seed=0, without=OTHERS, wording=axis.wording)


@pytest.mark.parametrize(
    ("plant", "effect", "expected"),
    [
        ("command_delay", "command_delay", {"dead_time_s": (0.03, 0.001)}),
        ("drive_lag", "drive_lag", {"time_constant_s": (0.06, 0.003)}),
        ("drive_saturation", "drive_saturation", {"limit_nm": (1.1, 0.02)}),
        ("speed", "drive_saturation", {"limit_nm": (1.6, 0.05), "fall_nm_s_per_rad": (0.45, 0.04)}),
        ("position", "drive_saturation", {"limit_nm": (4.0, 0.15)}),
        (
            "cogging",
            "cogging",
            {
                "period_deg": (6.0, 0.02),
                "sine_nm": (0.15 * np.cos(0.7), 0.01),
                "cosine_nm": (0.15 * np.sin(0.7), 0.01),
            },
        ),
        ("directional_friction", "directional_friction", {"drag_nm_s_per_rad": (0.25, 0.025)}),
    ],
)
def test_the_effect_of_an_independent_plant_is_named_first(
    tmp_path: Path, plant: str, effect: str, expected: dict[str, tuple[float, float]]
) -> None:
    """Fails when a drive's effect is called otherwise, its numbers are wrong, or model.yaml does not predict a run."""
    axis = machine(tmp_path, plant, 7)
    found = diagnosed(axis)
    assert found.findings, found.verdict
    assert found.findings[0].effect == effect
    numbers = {number.key.partition(".")[2]: number.value for number in found.findings[0].numbers}
    for key, (value, tolerance) in expected.items():
        assert numbers[key] == pytest.approx(value, abs=tolerance), key
    write_machine_model(found, axis.description, ["run"], tmp_path / "model.yaml")
    machine(tmp_path / "other", plant, 8)
    errors = []
    for file in (tmp_path / "axis.yaml", tmp_path / "model.yaml"):
        loaded = load_machine(file, [tmp_path / "other" / "run.npz"])
        scores = predict(loaded.signals, loaded.model, wording=loaded.wording).joints[0].scores
        errors.append(next(score.rmse for score in scores if STAGES[score.stage] == "angle"))
    assert errors[1] < 0.15 * errors[0]


def test_no_effect_of_a_drive_is_reported_where_there_is_none(tmp_path: Path) -> None:
    """Fails when noise is taken for a delay, a lag, a limit, cogging or friction of one direction."""
    assert diagnosed(machine(tmp_path, "none", 9)).findings == ()


def speed_drive(folder: Path, controller: dict[str, Any], seed: int) -> Path:
    """A recording of an axis whose drive follows a command of the speed, in part by an integral; its machine file."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    time, knots = np.arange(0.0, 12.0, 0.005), np.arange(0.0, 12.5, 0.4)
    command = np.interp(time, knots, rng.uniform(-1.5, 1.5, len(knots)))
    proportional, integral = 2.0, float(controller.get("stiffness", 0.0))

    def rates(t: float, y: np.ndarray) -> list[float]:
        error = float(np.interp(t, time, command)) - y[1]
        return [y[1], (proportional * error + integral * y[2] - 0.5 * np.tanh(y[1] / 0.01)) / INERTIA, error]

    found = solve_ivp(rates, (0.0, time[-1]), [0.3, 0.0, 0.0], "LSODA", time, max_step=0.01, rtol=1e-7)
    np.savez(folder / "run.npz", t=time, u=command, x=found.y[0] + NOISE_RAD * rng.standard_normal(len(time)))
    content = {key: value for key, value in AXIS.items() if key not in ("gain", "stiffness", "damping")}
    content |= {"controller": {"of": "speed", **controller}}
    (folder / "drive.yaml").write_text(json.dumps(content), encoding="utf-8")
    return folder / "drive.yaml"


@pytest.mark.parametrize("controller", [{"time_constant": 0.01}, {"damping": 2.0, "stiffness": 30.0}])
def test_friction_of_an_axis_with_a_speed_drive(tmp_path: Path, controller: dict[str, Any]) -> None:
    """Fails when a command of the speed is taken for a force or a position, or its integral has another beginning."""
    path = speed_drive(tmp_path, controller, 3)
    axis = load_machine(path, [tmp_path / "run.npz"], to_fit=True)
    found = diagnosed(axis)
    assert [finding.effect for finding in found.findings] == ["coulomb_friction"]
    level = next(n for n in found.findings[0].numbers if n.key == "coulomb_friction.torque_nm")
    # Without an integral, a part of it is taken for damping of the axis, which is free within 5 % of the drive's.
    assert level.value == pytest.approx(0.5, abs=0.02 if "stiffness" in controller else 0.05)


def test_the_command_of_a_speed_drive_and_its_integral(tmp_path: Path) -> None:
    """Fails when the integral is added without an integral part, does not begin at the position, or has no numbers."""
    path = speed_drive(tmp_path, {"damping": 2.0, "stiffness": 30.0}, 3)
    described = load_description(path)
    assert (described.gain, described.stiffness, described.damping) == (2.0, 30.0, 2.0)
    with np.load(tmp_path / "run.npz") as run:
        time, command, position = run["t"], run["u"], run["x"]
    expected = command + 15.0 * (position[0] + np.r_[0.0, np.cumsum(0.0025 * (command[1:] + command[:-1]))])
    assert np.allclose(read_machine(described, tmp_path / "run.npz").signals["input"], expected, atol=1e-9)
    plain = load_description(speed_drive(tmp_path, {"time_constant": 0.01}, 3))
    assert (plain.gain, plain.stiffness, plain.damping) == (2.0, 0.0, 2.0)
    assert np.allclose(read_machine(plain, tmp_path / "run.npz").signals["input"], command)
    assert len(time) == 2400


@pytest.mark.parametrize(
    ("controller", "line"),
    [
        ({"of": "current", "damping": 1.0}, "controller.of is 'current'; it must be one of position, speed"),
        ({"of": "speed"}, "controller.damping is missing"),
        ({"of": "speed", "damping": 1.0, "time_constant": 0.1}, "controller.damping follows from time_constant"),
        ({"of": "position", "stiffness": 1.0, "time_constant": 0.1}, "controller.time_constant is that of a drive"),
        ({"of": "speed", "time_constant": 1e3}, "controller.time_constant is 1000.0; the allowed range is"),
    ],
)
def test_a_wrong_controller_is_refused_in_one_line(tmp_path: Path, controller: dict[str, Any], line: str) -> None:
    """Fails when a controller without its numbers, or with contradictory ones, is accepted."""
    content = {key: value for key, value in AXIS.items() if key != "gain"} | {"controller": controller}
    (tmp_path / "axis.yaml").write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(DescriptionError, match=line) as refused:
        load_description(tmp_path / "axis.yaml")
    assert "\n" not in str(refused.value)
