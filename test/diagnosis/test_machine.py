"""Machines other than a hand: a rig that imposes the motion, an arm and a pendulum moved by a torque."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from typer.testing import CliRunner

from hand_diagnosis.diagnosis import diagnose
from hand_diagnosis.judgement import Number, joint_findings
from hand_diagnosis.judgement import remainder as remainders
from hand_diagnosis.report import schema
from hand_model.description import Hand
from hand_model.effects import EFFECTS
from hand_tool.cli import app
from test.diagnosis.recordings import changed, off_by_a_little, record

CYLINDER = """
schema: 1
name: cylinder
motion: linear
imposed: true
gain: 5.0e-4
columns:
  time: {column: t}
  input: {column: p_bar, scale: 1.0e+5}
  position: {column: x_mm, scale: 1.0e-3}
  force: {column: f}
"""
PENDULUM = """
schema: 1
name: arm
motion: rotary
gain: 2.0
stiffness: 2.0
damping: 0.05
inertia: 0.005
columns:
  time: {column: t}
  input: {column: goal}
  position: {column: angle}
"""


def run(folder: Path, machine: str, table: np.ndarray, header: str) -> dict[str, object]:
    (folder / "machine.yaml").write_text(machine, encoding="utf-8")
    np.savetxt(folder / "data.csv", table, delimiter=",", header=header, comments="", fmt="%.7g")
    out = folder / "out"
    arguments = ["diagnose", str(folder / "data.csv"), "--machine", str(folder / "machine.yaml"), "--out", str(out)]
    result = CliRunner().invoke(app, [*arguments, "--json"])
    assert result.exit_code == 0, result.output
    content: dict[str, object] = json.loads(result.output.splitlines()[-1])
    jsonschema.validate(content, schema())
    assert (out / "report.html").exists()
    return content


def test_seal_friction_of_a_cylinder(tmp_path: Path) -> None:
    """Fails when friction against an imposed motion is not seen in the force, or comes back in other units."""
    rng = np.random.default_rng(2)
    time = np.arange(0.0, 60.0, 0.01)
    x = 20.0 * (1.0 - np.cos(2 * np.pi * time / 9.0))
    speed = np.gradient(x, time)
    pressure = 3.0 + 0.3 * np.sin(2 * np.pi * time / 23.0)
    force = 50.0 * pressure - 8.0 * np.tanh(speed / 0.2) + 0.3 * rng.standard_normal(len(time))
    content = run(tmp_path, CYLINDER, np.column_stack([time, pressure, x, force]), "t,p_bar,x_mm,f")
    first = content["findings"][0]  # type: ignore[index]
    assert first["effect"] == "coulomb_friction"
    parameters = first["parameters"]
    total = parameters["coulomb_friction.force_n"]["value"]
    total += 3e5 * parameters["coulomb_friction.force_n_per_input"]["value"]
    assert parameters["coulomb_friction.force_n"]["unit"] == "N"
    assert total == pytest.approx(8.0, rel=0.1)


def driven_arm(shaken_nm: float) -> np.ndarray:
    """Time, goal and angle of an arm with friction, shaken by a torque at 1.7 Hz."""
    rng = np.random.default_rng(3)
    period, steps = 0.005, 10
    time = np.arange(0.0, 40.0, period)
    goal = np.interp(time, np.arange(0, 45, 1.5), rng.uniform(-0.8, 0.8, 30))
    angle, speed, angles = 0.0, 0.0, []
    for now, target in zip(time, goal, strict=True):
        angles.append(angle)
        for _ in range(steps):  # fine Euler steps with a steep sign: no code shared with the tool
            torque = (
                shaken_nm * np.sin(2 * np.pi * 1.7 * now)
                + 2.0 * (target - angle)
                - 0.05 * speed
                - 0.12 * np.tanh(speed / 2e-3)
            )
            speed += period / steps * torque / 0.005
            angle += period / steps * speed
    noisy = np.array(angles) + 5e-4 * rng.standard_normal(len(angles))
    return np.column_stack([time, goal, noisy])


def test_friction_of_a_driven_arm(tmp_path: Path) -> None:
    """Fails when an axis that is moved by its input is not simulated in its own inertia, damping and stiffness."""
    content = run(tmp_path, PENDULUM, driven_arm(0.0), "t,goal,angle")
    first = content["findings"][0]  # type: ignore[index]
    assert first["effect"] == "coulomb_friction"
    number = first["parameters"]["coulomb_friction.torque_nm"]
    assert number["unit"] == "N m"
    assert number["value"] == pytest.approx(0.12, rel=0.15)


SWINGING = """
schema: 1
name: pendulum
motion: rotary
gain: 1.0
damping: 0.003
inertia: 0.006
weight: 0.5
columns:
  time: {column: t}
  input: {column: idle}
  position: {column: angle}
"""


def swings() -> np.ndarray:
    """Time, idle input and angle of a pendulum that is recorded in mid-swing."""
    rng = np.random.default_rng(4)
    period, steps = 0.005, 20
    time = np.arange(0.0, 10.0, period)
    angle, speed, angles = 0.7, -3.0, []
    for _ in time:
        angles.append(angle)
        for _ in range(steps):
            torque = -0.5 * np.sin(angle) - 0.012 * np.tanh(speed / 5e-3) - 0.003 * speed
            speed += period / steps * torque / 0.006
            angle += period / steps * speed
    noisy = np.array(angles) + 4e-4 * rng.standard_normal(len(angles))
    return np.column_stack([time, np.zeros(len(time)), noisy])


def test_a_falling_pendulum_loses_to_friction(tmp_path: Path) -> None:
    """Fails when weight, an idle input or a start in mid-swing is not handled."""
    content = run(tmp_path, SWINGING, swings(), "t,idle,angle")
    first = content["findings"][0]  # type: ignore[index]
    assert first["effect"] == "coulomb_friction"
    assert first["parameters"]["coulomb_friction.torque_nm"]["value"] == pytest.approx(0.012, rel=0.1)
    inertia = [row for row in content["parameter_changes"] if row["parameter"] == "dynamics.inertia_kg_m2"]  # type: ignore[attr-defined]
    assert all(row["nominal"] == pytest.approx(0.006) for row in inertia)  # in the machine's own units


@pytest.mark.long
def test_a_part_that_is_known_stands_next_to_the_unknown(tmp_path: Path) -> None:
    """Fails when a remainder hides the effect that explains a part of it, or has the units of a finger."""
    content = run(tmp_path, PENDULUM, driven_arm(shaken_nm=0.05), "t,goal,angle")
    left = content["remainder"][0]  # type: ignore[index]
    assert left["probability"] > 0.5
    named = [*content["findings"], *left["candidates"]]  # type: ignore[misc]
    friction = next(each for each in named if each["effect"] == "coulomb_friction")
    assert friction["parameters"]["coulomb_friction.torque_nm"]["value"] < 0.12  # dither helps the arm slide
    assert friction["parameters"]["coulomb_friction.torque_nm"]["value"] > 0.06
    test = next(row for row in content["fit"] if row["split"] == "test" and row["signal"] == "angle")  # type: ignore[attr-defined]
    assert f"to {test['rmse_after']:.3g} deg" in left["statement"]


@pytest.mark.long
def test_two_effects_on_one_joint(hand: Hand, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a second effect hides behind the first, or its probability is that of the first round."""
    rng = np.random.default_rng(70)
    truth = changed(hand, "index_distal", coulomb_friction__torque_nm=0.008, valve_deadband__width_pa=4e3)
    signals = record(truth, rng)
    nominal = off_by_a_little(hand, rng)
    result = diagnose([signals], nominal, tolerance=0.05, seed=0, joints=["index_distal"], sensor_curve=False)
    assert {finding.effect for finding in result.findings} == {"coulomb_friction", "valve_deadband"}
    assert all(finding.probability > 0.5 for finding in result.findings)
    joint = result.joints[0]
    assert len(joint_findings(joint)) == 2
    # Two effects whose numbers have the same short names: each sentence has its own numbers.
    first = joint.search.accepted[0]
    joint.search.accepted[1] = replace(joint.search.accepted[1], effect=EFFECTS["hysteresis"], stage=first.stage)
    sizes = {"coulomb_friction": 1.0, "hysteresis": 2.0}
    monkeypatch.setattr(
        remainders,
        "parameter_numbers",
        lambda _, effect, __: [Number(key, sizes[effect.name], 0.1, "N m", True) for key in effect.keys],
    )
    stage = next(result for result in joint.results if result.stage == joint.search.accepted[0].stage)
    worse = replace(stage, excess_after=stage.excess_before, elsewhere=())  # nothing is claimed
    statement = remainders.remainder(replace(joint, results=(worse,)), worse).statement
    assert "Coulomb friction of 1 ± 0.1 N m" in statement
    assert "a hysteresis loop of 2 ± 0.1 N m" in statement


@pytest.mark.parametrize(
    ("machine", "line"),
    [
        (CYLINDER.replace("gain: 5.0e-4", "gain: none"), "gain"),
        (CYLINDER.replace("column: f}", "column: load}"), "no column 'load'"),
        (CYLINDER.replace("motion: linear", "motion: sideways"), "one of linear, rotary"),
        ("", "machine.yaml"),
    ],
)
def test_a_wrong_machine_file_is_one_line(machine: str, line: str, tmp_path: Path) -> None:
    """Fails when a wrong machine file gives a traceback or a finding."""
    (tmp_path / "machine.yaml").write_text(machine, encoding="utf-8")
    (tmp_path / "data.csv").write_text("t,p_bar,x_mm,f\n" + "".join(f"{k},1,{k},1\n" for k in range(50)), "utf-8")
    files = [str(tmp_path / "data.csv"), "--machine", str(tmp_path / "machine.yaml")]
    result = CliRunner().invoke(app, ["diagnose", *files, "--out", str(tmp_path / "out")])
    said = [text for text in result.output.splitlines() if text.strip()]
    assert result.exit_code == 2, result.output
    assert len(said) == 1, said
    assert line in said[0]
