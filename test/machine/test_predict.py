"""model.yaml of a machine holds all that was found, and predicts recordings that were not in the fit."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

from hand_diagnosis.diagnosis import Diagnosis, diagnose
from hand_diagnosis.found_machine import write_machine_model
from hand_diagnosis.prediction import predict
from hand_machine.description import load_description
from hand_machine.found_model import Found, put_effects, write_found_model
from hand_machine.machine import load_machine
from hand_machine.wording import units_of
from hand_model.effects import EFFECTS
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_model.yaml_loader import DescriptionError
from hand_tool.cli import app

MACHINE = """# a slide on a spring
schema: 1
name: slide
motion: linear
gain: {value: 1.0, exact: true}
stiffness: 62.0  # N/m
damping: {value: 1.5, tolerance: 0.2}
inertia: 0.29
columns:
  time: {column: t}
  input: {column: u}
  position: {column: x_mm, scale: 1.0e-3}
"""
NOISE_MM, FRICTION_N, SECONDS = 0.02, 0.25, 12.0


def save(path: Path, seed: int) -> None:
    """A recording of the slide: its equation of motion with Coulomb friction, by scipy.integrate.solve_ivp."""
    rng = np.random.default_rng(seed)
    knots = np.arange(0.0, SECONDS + 1.0, 0.8)
    levels = rng.uniform(-2.0, 2.0, len(knots))
    times = np.arange(0.0, SECONDS, 0.005)

    def slope(t: float, y: np.ndarray) -> list[float]:
        force = np.interp(t, knots, levels) - 60.0 * y[0] - 1.5 * y[1] - FRICTION_N * np.tanh(y[1] / 2e-3)
        return [y[1], force / 0.3]

    x = solve_ivp(slope, (0.0, SECONDS), [0.0, 0.0], "LSODA", times, rtol=1e-6, atol=1e-8, max_step=0.02).y[0]
    noise = NOISE_MM * rng.standard_normal(len(times))
    np.savez(path, t=times, u=np.interp(times, knots, levels), x_mm=1e3 * x + noise)


@dataclass(frozen=True)
class Diagnosed:
    """A folder with machine.yaml, fitted.npz, other.npz and the model.yaml found, and the diagnosis of fitted.npz."""

    folder: Path
    result: Diagnosis


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory: pytest.TempPathFactory) -> Diagnosed:
    folder = tmp_path_factory.mktemp("slide")
    (folder / "machine.yaml").write_text(MACHINE, encoding="utf-8")
    for seed, name in enumerate(("fitted.npz", "other.npz"), 1):
        save(folder / name, seed)
    machine = load_machine(folder / "machine.yaml", [folder / "fitted.npz"])
    others = [name for name in EFFECTS if name not in {"coulomb_friction", "angle_offset"}]
    result = diagnose(machine.signals, machine.model, tolerance=0.05, seed=0, without=others, wording=machine.wording)
    write_machine_model(result, machine.description, ["fitted.npz"], folder / "model.yaml")
    return Diagnosed(folder, result)


def error_mm(diagnosed: Diagnosed, model: str, recording: str) -> float:
    machine = load_machine(diagnosed.folder / model, [diagnosed.folder / recording])
    found = predict(machine.signals, machine.model, wording=machine.wording)
    return machine.wording.signal_units[1][0] * found.joints[0].scores[0].rmse


def test_the_model_predicts_what_its_fit_gave(diagnosed: Diagnosed) -> None:
    """Fails when model.yaml lacks a number, a law or a size of the fit, or has one in another unit.

    Its numbers are rounded to a tenth of what the data notice. Where friction holds, the last digit of a number decides
    where the slide has stopped: single samples may differ more than all together.
    """
    joint = diagnosed.result.joints[0]
    residual, segment = joint.reported.final.residuals[0][1], joint.reported.problem.segments[0]
    machine = load_machine(diagnosed.folder / "model.yaml", [diagnosed.folder / "fitted.npz"])
    found = predict(machine.signals, machine.model, wording=machine.wording).joints[0]
    count = len(residual)
    again = (found.segments[0].measured - found.predicted[0])[1][:count]
    use = segment.use[1]
    assert use.sum() > 1000
    noticed = joint.search.problem.floor[1]
    print(np.sqrt(np.mean((again - residual)[use] ** 2)) / noticed, np.sqrt(np.mean(residual[use] ** 2)) / noticed)
    assert np.sqrt(np.mean((again - residual)[use] ** 2)) < 0.1 * noticed
    assert np.sqrt(np.mean(again[use] ** 2)) == pytest.approx(np.sqrt(np.mean(residual[use] ** 2)), rel=0.02)


def test_it_predicts_a_recording_that_was_not_in_the_fit(diagnosed: Diagnosed) -> None:
    """Fails when the model found is no better on another recording than the nominal one, or far from its noise."""
    before, after = (error_mm(diagnosed, name, "other.npz") for name in ("machine.yaml", "model.yaml"))
    assert after < 0.1 * before
    assert after < 10.0 * NOISE_MM


def test_the_file_keeps_comments_and_states(diagnosed: Diagnosed) -> None:
    """Fails when a comment, how well a number is known, or the standard error of a finding is lost."""
    text = (diagnosed.folder / "model.yaml").read_text(encoding="utf-8")
    assert "# a slide on a spring" in text
    assert "# N/m" in text
    assert "gain: {value: 1.0, exact: true}" in text
    described = load_description(diagnosed.folder / "model.yaml")
    assert described.tolerances == {"gain": 0.0, "damping": 0.2}
    assert abs(described.stiffness - 60.0) < 1.0
    assert abs(described.effects["coulomb_friction.force_n"] - FRICTION_N) < 0.02
    said = next(n for f in diagnosed.result.findings for n in f.numbers if n.key == "coulomb_friction.force_n")
    assert f"std: {said.std:.2g}" in text


@pytest.mark.parametrize("linear", [True, False])
def test_every_parameter_survives_the_file(tmp_path: Path, linear: bool) -> None:
    """Fails when a parameter of any effect has no key of its own in the file, or another value after reading."""
    text = MACHINE if linear else MACHINE.replace("linear", "rotary")
    (tmp_path / "machine.yaml").write_text(text, encoding="utf-8")
    rng = np.random.default_rng(3)
    low, high = (np.array([getattr(p, end) * p.scale for p in JOINT_PARAMETERS]) for end in ("low", "high"))
    values = low + rng.uniform(0.1, 0.9, len(low)) * (high - low)
    units = units_of(linear, per_torque=7.0, per_angle=0.03 if linear else 1.0, per_input=2e-5)
    keys = [key for key in ROW if key not in ("statics.a1_nm_per_rad",)]
    found = Found({key: float(values[ROW[key]]) for key in keys}, {}, dict.fromkeys(keys, 1e-9), frozenset(keys))
    described = load_description(tmp_path / "machine.yaml")
    write_found_model(described, units, found, tmp_path / "model.yaml", "")
    again = load_description(tmp_path / "model.yaml")
    parameters = np.zeros(len(low))
    put_effects(again, units, parameters)
    kept = [ROW[key] for key in keys if units.quantity(key).key in again.effects]
    assert len(kept) >= len(keys) - 4
    assert np.allclose(parameters[kept], values[kept], rtol=1e-4)
    assert again.inertia == pytest.approx(
        float(values[ROW["dynamics.inertia_kg_m2"]]) * units.per_torque / units.per_angle, rel=1e-4
    )
    assert again.sizes == (units.per_torque, units.per_angle, units.per_pressure)


def test_a_number_at_its_bound_is_not_rounded_out_of_its_range(tmp_path: Path) -> None:
    """Fails when a coarse number near a bound is written beyond it, and the file that was written is refused."""
    (tmp_path / "machine.yaml").write_text(MACHINE, encoding="utf-8")
    described = load_description(tmp_path / "machine.yaml")
    units = units_of(True, per_torque=7.0, per_angle=0.0313, per_input=2e-5)
    key = "hysteresis.scale_deg"
    parameter = JOINT_PARAMETERS[ROW[key]]
    low = parameter.low * parameter.scale
    found = Found({key: low}, {}, {key: 0.5 * low}, frozenset({key}))
    write_found_model(described, units, found, tmp_path / "model.yaml", "")
    parameters = np.zeros(len(JOINT_PARAMETERS))
    put_effects(load_description(tmp_path / "model.yaml"), units, parameters)
    assert parameters[ROW[key]] == pytest.approx(low, rel=1e-4)


@pytest.mark.parametrize(
    ("section", "line"),
    [
        ("effects: {coulomb_friction.torque_nm: 0.1}", "effects.'coulomb_friction.torque_nm' is not a known key"),
        ("effects: {coulomb_friction.force_n: -1.0}", "effects.coulomb_friction.force_n is -1; the allowed range is 0"),
        ("effects: {coulomb_friction.force_n: {value: x}}", "coulomb_friction.force_n.value is 'x'; it must be a numb"),
        ("sizes: {force: 1.0}", "sizes.position is missing; it must be a number"),
        ("sizes: {force: 0.0, position: 1.0, input: 1.0}", "sizes.force is 0.0; the allowed range is 1e-12"),
    ],
)
def test_bad_models_are_refused_in_one_line(diagnosed: Diagnosed, tmp_path: Path, section: str, line: str) -> None:
    """Fails when a wrong key or value is ignored, or the line does not say what is allowed."""
    (tmp_path / "model.yaml").write_text(f"{MACHINE}{section}\n", encoding="utf-8")
    with pytest.raises(DescriptionError) as refused:
        load_machine(tmp_path / "model.yaml", [diagnosed.folder / "other.npz"])
    assert line in str(refused.value)
    assert "\n" not in str(refused.value)


def test_the_command_writes_a_score_and_a_page(diagnosed: Diagnosed) -> None:
    """Fails when the command does not say the error in the machine's unit, or a file is missing."""
    recording, model, out = (diagnosed.folder / name for name in ("other.npz", "model.yaml", "out"))
    result = CliRunner().invoke(app, ["predict", str(recording), "--model", str(model), "--out", str(out), "--json"])
    assert result.exit_code == 0, result.output
    content = json.loads(result.output.splitlines()[-1])
    row = content["scores"][0]
    assert (row["signal"], row["unit"], row["recording"]) == ("position", "mm", "other.npz")
    assert row["rmse"] == pytest.approx(error_mm(diagnosed, "model.yaml", "other.npz"))
    assert 0.5 * NOISE_MM < row["noise_floor"] < 2.0 * NOISE_MM
    assert json.loads((out / "prediction.json").read_text(encoding="utf-8"))["scores"] == content["scores"]
    page = (out / "prediction.html").read_text(encoding="utf-8")
    assert "times the noise" in page
    assert "position of axis over time: error" in page


def test_options_of_a_hand_are_refused(diagnosed: Diagnosed) -> None:
    """Fails when an option without a part in a machine is ignored in silence."""
    recording, model = (diagnosed.folder / name for name in ("other.npz", "model.yaml"))
    for option in ("--joints=axis", "--no-sensor-curve"):
        result = CliRunner().invoke(app, ["predict", str(recording), "--model", str(model), option])
        assert result.exit_code == 2
        assert "cannot be used with a machine file" in result.stderr
