"""The valve that NASA wrote: its motion, its machine file, and a sealed trial of it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from hand_machine.description import load_description
from validation.referees import progpy_valve
from validation.referees.progpy_valve import OFF, machine_file, make, simulate, valve
from validation.trial.answers import export
from validation.trial.run import recording_of
from validation.trial.seal import new_key, unseal

SEED = 3


def test_the_machine_file_says_what_the_valve_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a sign, a unit or the constant force of the machine file is another one than progpy's: then the
    forces of the file do not balance where the piston hardly accelerates.
    """
    monkeypatch.setattr(progpy_valve, "RECORDED_S", 3.0)
    print("seed", SEED)
    pressure, position = simulate(valve({}), np.random.default_rng(SEED))
    path = tmp_path / "machine.yaml"
    path.write_text(machine_file(valve({}).parameters, dict.fromkeys(OFF, 1.0)), encoding="utf-8")
    machine = load_description(path)
    columns = machine.columns
    input_pa, x = pressure + columns["input"].offset, position + columns["position"].offset
    speed = np.gradient(position, 0.01)
    left = machine.gain * input_pa - machine.stiffness * x - machine.damping * speed
    left -= machine.inertia * np.gradient(speed, 0.01)
    assert np.ptp(position) > 0.005 and position.min() > 0.0 and position.max() < 0.0381  # it does not touch its stops
    assert np.median(np.abs(left)) < 0.02 * np.ptp(machine.stiffness * x)  # where commands change, the differences miss


def test_a_trial_is_sealed_and_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a case lacks its recording, its machine file, its truth or its plan, or the export loses one."""
    monkeypatch.setattr(progpy_valve, "RECORDED_S", 1.0)
    key, shares = new_key(), list[float]()
    make(tmp_path / "trial", 4, SEED, key, jobs=1, progress=shares.append)
    truth, _ = unseal(tmp_path / "trial", key)
    plan = json.loads((tmp_path / "trial" / "plan.json").read_text(encoding="utf-8"))
    assert len(plan) == len(truth["cases"]) == 4 and shares[-1] == 1.0
    assert [len(case["truth"]) for case in truth["cases"]].count(0) == 1
    assert export(tmp_path / "trial", tmp_path / "task") == 4
    for case in plan:
        for folder in (tmp_path / "trial", tmp_path / "task"):
            assert recording_of(folder, case["model"], case["number"]).is_file()
            assert load_description(folder / case["model"]).name == "pneumatic_valve"
