"""Friction under load, springs of either sign and hidden gains on an independent plant: the right name first."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hand_diagnosis.diagnosis import Diagnosis, diagnose
from hand_machine.machine import Machine, load_machine
from hand_model.effects import CATALOGUE

INERTIA, DAMPING, WEIGHT = 0.02, 0.12, 0.5
TRIED = {
    *("coulomb_friction", "viscous_friction", "directional_friction", "gear_friction", "constant_load", "stiffening"),
    *("spring", "gravity", "drive_gain", "drive_lag", "drive_saturation", "command_delay", "added_inertia"),
}
OTHERS = [effect.name for effect in CATALOGUE if effect.name not in TRIED]
DECOYS = {"viscous_friction", "stiffening", "directional_friction", "added_inertia", "command_delay", "drive_lag"}
ENCODER_RAD = 2.0 * np.pi / 16384
PENDULUM: dict[str, Any] = {
    "schema": 1,
    "name": "pendulum",
    "motion": "rotary",
    "gain": 1.03,
    "damping": 0.97 * DAMPING,
    "inertia": 1.04 * INERTIA,
    "weight": {"value": 1.02 * WEIGHT, "tolerance": 0.05},
    "has": ["motor"],
    "columns": {"time": {"column": "t"}, "input": {"column": "u"}, "position": {"column": "x"}},
}
LOADS = {"run_0.npz": 0.0, "run_1.npz": 0.6}
"""Weight that is added in each recording, in shares of the pendulum's own."""
Torques = Callable[[float, float, float, float], tuple[float, float]]
"""(command, angle, speed, weight) -> torque of drive and springs, and magnitude of the dry friction [N m]."""


def extended(motor: float, load: float, speed: float) -> float:
    """Model M5 of Rhoban/bam: shares of both torques [N m], each with a part that an exponential of the speed ends."""
    falling = float(np.exp(-(abs(speed / 0.4) ** 1.3)))
    return 0.012 + (0.1 + 0.06 * falling) * abs(motor) + (0.16 + 0.06 * falling) * abs(load)


PLANTS: dict[str, Torques] = {
    "none": lambda u, x, v, weight: (u, 0.0),
    "coulomb_friction": lambda u, x, v, weight: (u, 0.08),
    "gear_friction": lambda u, x, v, weight: (u, extended(u, weight * np.sin(x), v)),
    "spring": lambda u, x, v, weight: (u - 0.35 * x, 0.0),
    "negative spring": lambda u, x, v, weight: (u + 0.2 * x, 0.0),
    "drive_gain": lambda u, x, v, weight: (1.45 * u, 0.0),
}

LARGEST = {"negative spring": 0.2}
"""Largest command [N m] where it is not 1: beyond it, this pendulum falls away from its rest."""


def recorded(folder: Path, name: str, plant: str, seed: int) -> None:
    """A recording at 200 Hz of the pendulum with its load, by an integrator of scipy; friction is a steep ramp."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    time, knots = np.arange(0.0, 16.0, 0.005), np.arange(0.0, 16.6, 0.6)
    command = np.interp(time, knots, rng.uniform(-0.75, 0.75, len(knots))) + 0.25 * np.sign(np.sin(1.7 * time))
    command *= LARGEST.get(plant, 1.0)
    inertia, weight = INERTIA * (1.0 + LOADS[name]), WEIGHT * (1.0 + LOADS[name])

    def rates(t: float, y: np.ndarray) -> list[float]:
        driving, level = PLANTS[plant](float(np.interp(t, time, command)), y[0], y[1], weight)
        rubbing = level * float(np.clip(y[1] / 2e-3, -1.0, 1.0))
        return [y[1], (driving - weight * np.sin(y[0]) - DAMPING * y[1] - rubbing) / inertia]

    found = solve_ivp(rates, (0.0, time[-1]), [0.0, 0.0], "LSODA", time, max_step=0.01, rtol=1e-6, atol=1e-8)
    angle = ENCODER_RAD * np.round((found.y[0] + 1e-4 * rng.standard_normal(len(time))) / ENCODER_RAD)
    np.savez(folder / name, t=time, u=command, x=angle)


def machine(folder: Path, plant: str, seed: int) -> Machine:
    for number, name in enumerate(LOADS):
        recorded(folder, name, plant, seed + number)
    loads = {name: {"added_inertia": INERTIA * load, "added_weight": WEIGHT * load} for name, load in LOADS.items()}
    content = PENDULUM | {"recordings": loads}
    (folder / "pendulum.yaml").write_text(json.dumps(content), encoding="utf-8")
    return load_machine(folder / "pendulum.yaml", [folder / name for name in LOADS], to_fit=True)


def diagnosed(axis: Machine) -> Diagnosis:
    return diagnose(axis.signals, axis.model, tolerance=0.05, seed=0, without=OTHERS, wording=axis.wording)


@pytest.mark.parametrize(
    ("plant", "effect", "expected"),
    [
        ("coulomb_friction", "coulomb_friction", {"torque_nm": (0.08, 0.01)}),
        pytest.param(
            *("gear_friction", "gear_friction", {"per_drive": (0.13, 0.06), "per_load": (0.19, 0.06)}),
            marks=pytest.mark.long,
        ),
        pytest.param("spring", "spring", {"stiffness_nm_per_rad": (0.35, 0.04)}, marks=pytest.mark.long),
        ("negative spring", "spring", {"stiffness_nm_per_rad": (-0.2, 0.02)}),
        ("drive_gain", "drive_gain", {"error": (0.45 / 1.03, 0.07)}),
    ],
)
def test_the_effect_of_an_independent_plant_is_named_first(
    tmp_path: Path, plant: str, effect: str, expected: dict[str, tuple[float, float]]
) -> None:
    """Fails when another effect is named first, a decoy is believed, or the numbers are those of another plant."""
    found = diagnosed(machine(tmp_path, plant, 11))
    assert found.findings, found.verdict
    assert found.findings[0].effect == effect
    believed = {finding.effect for finding in found.findings if finding.probability > 0.5}
    assert not believed & DECOYS
    numbers = {number.key.partition(".")[2]: number.value for number in found.findings[0].numbers}
    for key, (value, tolerance) in expected.items():
        assert numbers[key] == pytest.approx(value, abs=tolerance), key


def test_nothing_is_found_where_the_model_lacks_nothing(tmp_path: Path) -> None:
    """Fails when noise or wrong nominal numbers are taken for friction under load, a spring or another gain."""
    assert diagnosed(machine(tmp_path, "none", 21)).findings == ()
