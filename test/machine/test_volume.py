"""A closed volume whose pressure is all that is measured: its leak, by gas dynamics that are not those of the model."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hand_diagnosis import machine_experiments
from hand_diagnosis.diagnosis import Diagnosis, diagnose
from hand_diagnosis.found_machine import write_machine_model
from hand_diagnosis.prediction import predict
from hand_identification.joint_data import joint_problem
from hand_identification.joint_problem import STAGES
from hand_machine.description import load_description
from hand_machine.machine import Machine, load_machine
from hand_model.kernel.rows import ROW
from hand_model.yaml_loader import DescriptionError

ATMOSPHERE_PA, VOLUME_M3, HEAT_J_KG = 101325.0, 1e-4, 287.0 * 293.15
"""Room, volume, and R T of air at 20 degrees C."""
FILE: dict[str, Any] = {
    "schema": 1,
    "name": "bellows",
    "motion": "none",
    "has": ["input_sensor"],
    "columns": {"time": {"column": "t_s"}, "pressure": {"column": "p_bar", "scale": 1e5}},
}


def lost(kind: str, pressure: float) -> float:
    """Mass flow [kg/s] from a gauge pressure [Pa]: of a gap (Hagen-Poiseuille) or an orifice (ISO 6358-1)."""
    absolute = pressure + ATMOSPHERE_PA
    if kind == "gap":
        return 1.2e-17 * (absolute**2 - ATMOSPHERE_PA**2)
    ratio, critical = ATMOSPHERE_PA / absolute, 0.4
    share = 1.0 if ratio <= critical else np.sqrt(max(1.0 - ((ratio - critical) / (1.0 - critical)) ** 2, 0.0))
    return 5e-12 * 1.185 * absolute * float(share) if kind == "hole" else 0.0


def machine(folder: Path, kind: str, fillings_pa: tuple[float, ...], seed: int) -> Machine:
    """The volume and a recording at 20 Hz of a minute after each filling; the sensor has noise of 60 Pa and steps."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    folder.mkdir(exist_ok=True)
    time, names = np.arange(0.0, 60.0, 0.05), []
    for filling in fillings_pa:
        found = solve_ivp(
            lambda _, p: [-HEAT_J_KG / VOLUME_M3 * lost(kind, p[0])], (0.0, 60.0), [filling], "LSODA", time, rtol=1e-8
        )
        read = 25.0 * np.round((found.y[0] + 60.0 * rng.standard_normal(len(time))) / 25.0)
        names.append(folder / f"from_{filling / 1e5:g}_bar.npz")
        np.savez(names[-1], t_s=time, p_bar=read / 1e5)
    (folder / "bellows.yaml").write_text(json.dumps(FILE), encoding="utf-8")
    return load_machine(folder / "bellows.yaml", names, to_fit=True)


def diagnosed(volume: Machine) -> Diagnosis:
    return diagnose(volume.signals, volume.model, tolerance=0.05, seed=0, wording=volume.wording)


@pytest.mark.parametrize("kind", ["gap", "hole"])
def test_a_leak_is_named_and_predicts_another_filling(tmp_path: Path, kind: str) -> None:
    """Fails when a leak is called otherwise, its loss at 1 bar is wrong, or model.yaml does not carry over."""
    volume = machine(tmp_path, kind, (4e5, 2.5e5), 1)
    found = diagnosed(volume)
    assert found.findings and found.findings[0].effect == "leak", found.verdict
    assert not [finding.effect for finding in found.findings[1:] if finding.probability > 0.5]
    write_machine_model(found, volume.description, ["a", "b"], tmp_path / "model.yaml")
    rate = load_description(tmp_path / "model.yaml").effects["leak.rate_per_s"]
    growth = load_description(tmp_path / "model.yaml").effects.get("leak.with_pressure", 0.0)
    true = HEAT_J_KG / VOLUME_M3 * lost(kind, 1e5) / 1e5
    assert rate * (1.0 + 0.25 * growth) == pytest.approx(true, rel=0.15)
    machine(tmp_path / "other", kind, (3.2e5,), 2)
    errors = []
    for file in (tmp_path / "bellows.yaml", tmp_path / "model.yaml"):
        loaded = load_machine(file, [tmp_path / "other" / "from_3.2_bar.npz"])
        scores = predict(loaded.signals, loaded.model, wording=loaded.wording).joints[0].scores
        errors.append(next(score.rmse for score in scores if STAGES[score.stage] == "pressure"))
    assert errors[1] < 0.05 * errors[0]


def test_numbers_of_effects_are_in_pascal_as_the_report_gives_them(tmp_path: Path) -> None:
    """Fails when a file that names the offset of a sensor by its unit is refused, as that of an axis would be."""
    machine(tmp_path, "none", (4e5,), 5)
    content = FILE | {"effects": {"pressure_offset.offset_pa": 750.0}}
    (tmp_path / "bellows.yaml").write_text(json.dumps(content), encoding="utf-8")
    loaded = load_machine(tmp_path / "bellows.yaml", [tmp_path / "from_4_bar.npz"])
    assert loaded.model.parameters[ROW["pressure_offset.offset_pa"], 0] == pytest.approx(750.0)


def test_a_tight_volume_agrees(tmp_path: Path) -> None:
    """Fails when noise is taken for a leak, or an effect of motion is offered to a volume without one."""
    volume = machine(tmp_path, "none", (4e5, 2.5e5), 3)
    found = diagnosed(volume)
    assert (found.verdict, found.findings) == ("agrees", ())
    problem = joint_problem(volume.signals, volume.model, "volume")
    assert machine_experiments.performable(problem) == ("hold",)
    assert machine_experiments.how(problem, "hold", volume.wording).startswith("fill the volume to 400 kPa, close")


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"gain": 1.0}, "gain has no meaning with motion: none"),
        ({"columns": {"time": {"column": "t"}}}, "columns.pressure is missing"),
        ({"columns": {**FILE["columns"], "position": {"column": "x"}}}, "position"),
    ],
)
def test_a_volume_with_numbers_of_a_motion_is_refused(tmp_path: Path, changes: dict[str, Any], line: str) -> None:
    """Fails when a key of a moving axis is ignored in silence, or a volume without a pressure is accepted."""
    (tmp_path / "bellows.yaml").write_text(json.dumps(FILE | changes), encoding="utf-8")
    with pytest.raises(DescriptionError, match=line) as refused:
        load_description(tmp_path / "bellows.yaml")
    assert "\n" not in str(refused.value)
