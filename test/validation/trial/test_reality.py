"""Real machines and their baselines, on simulated recordings in the format of the published ones."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from validation.trial.baselines import imposed_baselines, moved_baselines
from validation.trial.document import reality_table
from validation.trial.reality import machines

PERIOD_S = 0.005


def swing(first_rad: float, seed: int) -> dict[str, np.ndarray]:
    """A pendulum that swings freely, with dry friction of 0.01 N m alone."""
    time = np.arange(0.0, 6.0, PERIOD_S)
    angle, speed, angles = first_rad, 0.0, []
    for _ in time:
        angles.append(angle)
        for _ in range(20):
            speed += PERIOD_S / 20 * (-0.5 * np.sin(angle) - 0.01 * np.tanh(speed / 5e-3)) / 0.006
            angle += PERIOD_S / 20 * speed
    noise = 2e-4 * np.random.default_rng(seed).standard_normal(len(time))
    return {"time": time, "position": np.array(angles) + noise, "input": np.zeros(len(time))}


def test_friction_models_of_a_free_swing_are_simulated() -> None:
    """Fails when a baseline is not given its best: the right form must come down to a fraction of a degree."""
    description = {"motion": "rotary", "inertia": 0.006, "weight": 0.5, "stiffness": 0.0, "gain": 1.0}
    errors = moved_baselines(description, {"a": swing(0.9, 1), "b": swing(-0.6, 2)})
    assert errors["Coulomb"]["validation"] < 0.2
    assert errors["viscous"]["validation"] > 3.0 * errors["Coulomb"]["validation"]
    assert errors["Coulomb, viscous, Stribeck, load, quadratic"]["train"] < 0.2
    assert np.isfinite(errors["SINDy discrepancy"]["validation"])


def test_friction_models_of_an_imposed_motion_are_regressed() -> None:
    """Fails when gain, stiffness or inertia are not taken off the force before friction is regressed."""
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 40.0, 0.01)
    x = 0.02 * np.sin(0.7 * time)
    speed, acceleration = 0.014 * np.cos(0.7 * time), -0.0098 * np.sin(0.7 * time)
    bar = 2.0 + 0.5 * np.sin(0.2 * time)
    force = 5e-4 * 1e5 * bar - 30.0 * x - 2.0 * acceleration - 8.0 * np.tanh(speed / 1e-4)
    columns = {"time": time, "position": x, "input": 1e5 * bar, "force": force + 0.3 * rng.standard_normal(len(time))}
    description = {"motion": "linear", "gain": 5e-4, "stiffness": 30.0, "inertia": 2.0}
    errors = imposed_baselines(description, {"a": columns})
    assert errors["Coulomb"]["validation"] < 0.8
    assert errors["viscous"]["validation"] > 2.0


def test_the_servos_logs_are_two_machines(tmp_path: Path) -> None:
    """Fails when the motor's torque, the fall after it is switched off, or the angle's zero is read wrongly."""
    folder = tmp_path / "servo_pendulum"
    folder.mkdir()
    common = {"mass": 0.5, "length": 0.1, "vin": 7.4, "dt": PERIOD_S}
    for name, kp, off in (("sin", 100, 1200), ("lift_and_drop", 100, 400), ("sin", 800, 1200)):
        rows = [
            {"timestamp": k * PERIOD_S, "position": 0.1 + 0.3 * np.cos(0.02 * k) * (k < 1000), "speed": 0.5,
             "goal_position": 0.9, "torque_enable": k < off}
            for k in range(1200)
        ]  # fmt: skip
        log = common | {"kp": kp, "trajectory": name, "entries": rows}
        (folder / f"{name}_{kp}.json").write_text(json.dumps(log), encoding="utf-8")
    driven, falling = machines(tmp_path)
    assert sorted(driven.recordings) == ["servo_100_lift_and_drop", "servo_100_sin"]
    assert len(driven.recordings["servo_100_lift_and_drop"]["time"]) == 400
    volts = 7.4 * 100 * 4096 / (2 * np.pi) / (256 * 885) * (0.9 - 0.4)
    assert driven.recordings["servo_100_sin"]["force"][0] == pytest.approx(-0.3867 / 4.017 * (volts - 0.3867 * 0.5))
    (fall,) = falling.recordings.values()
    assert fall["time"][0] == pytest.approx(2.45)
    assert fall["position"][-1] == 0.0
    assert falling.published["coulomb_friction.torque_nm"][0] == 0.0128
    assert falling.description["weight"] == pytest.approx(0.5 * 9.80665 * 0.1)


def test_the_table_of_real_machines() -> None:
    """Fails when a partial explanation or a parameter that was not found is reported as a finding."""
    errors, ours = {"validation": 2.0, "train": 1.0}, {"value": 0.49, "std": 0.01, "unit": "N m"}
    machine = {
        "machine": "rig", "verdict": "unknown_physics", "known": ["gravity"], "found": [], "found_in_part": ["gravity"],
        "decoys_taken": [], "before": 3.0, "after": 1.5, "unit": "deg", "findings": [{"statement": "said"}],
        "baselines": {"Coulomb": errors, "SINDy discrepancy": errors},
        "published": [
            {"key": "gravity.sine_nm", "published": 0.5, "source": "scales", "ours": ours},
            {"key": "leak.rate_per_s", "published": 0.1, "source": "guess", "ours": None},
        ],
    }  # fmt: skip
    table = reality_table([machine])
    assert "| rig | unknown_physics | gravity | gravity (a part) | none | 3 | 1.5 | 2 (Coulomb) | 2 | deg |" in table
    assert "| rig | `gravity.sine_nm` | 0.49 ± 0.01 N m | 0.5 | scales |" in table
    assert "| rig | `leak.rate_per_s` | not found | 0.1 | guess |" in table
