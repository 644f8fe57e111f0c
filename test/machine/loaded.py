"""Machines from a description and recordings, their errors and their diagnosis, for several tests."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from hand_diagnosis.diagnosis import Diagnosis, diagnose
from hand_diagnosis.prediction import predict
from hand_machine.machine import Machine, load_machine
from hand_model.effects import EFFECTS


def load(folder: Path, description: dict[str, Any], *names: str) -> Machine:
    (folder / "machine.yaml").write_text(json.dumps(description), encoding="utf-8")
    return load_machine(folder / "machine.yaml", [folder / name for name in names])


def errors(machine: Machine) -> list[float]:
    """RMS error of the angle of every recording [rad]."""
    return [score.rmse for score in predict(machine.signals, machine.model, wording=machine.wording).joints[0].scores]


def diagnosed(machine: Machine, *effects: str) -> Diagnosis:
    others = [name for name in EFFECTS if name not in effects]
    return diagnose(machine.signals, machine.model, tolerance=0.05, seed=0, without=others, wording=machine.wording)
