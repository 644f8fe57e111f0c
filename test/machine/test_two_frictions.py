"""Dry and viscous friction of one axis, both hidden: two names, not one law of dry friction that grows with the speed.

The plant is an integrator of scipy with a steep ramp for dry friction.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hand_diagnosis.diagnosis import Diagnosis, diagnose
from hand_machine.machine import load_machine
from hand_model.effects import CATALOGUE

MASS_KG, FORCE_N, DAMPING_N_S_PER_M = 95.0, 20.0, 210.0
SEED = 3
TRIED = {"coulomb_friction", "viscous_friction", "directional_friction", "hysteresis", "stiffening", "constant_load"}
OTHERS = [effect.name for effect in CATALOGUE if effect.name not in TRIED]
AXIS: dict[str, Any] = {
    "schema": 1,
    "name": "slide",
    "motion": "linear",
    "gain": 1.02,
    "inertia": 0.98 * MASS_KG,
    "has": ["motor"],
    "columns": {"time": {"column": "t"}, "input": {"column": "u"}, "position": {"column": "x"}},
}


def moved(path: Path) -> None:
    """Write 20 s at 200 Hz of a slide whose force is that of a controller along two sines."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    time = np.arange(0.0, 20.0, 0.005)

    def wanted(t: float) -> tuple[float, float]:
        angle, fast = 2.0 * np.pi * 0.1 * t, 2.0 * np.pi * 0.43 * t
        return 0.1 * np.sin(angle) + 0.02 * np.sin(fast), 0.0628 * np.cos(angle) + 0.054 * np.cos(fast)

    def force(t: float, x: float, v: float) -> float:
        place, speed = wanted(t)
        return 2e4 * (place - x) + 2e3 * (speed - v)

    def rates(t: float, y: np.ndarray) -> list[float]:
        rubbing = FORCE_N * float(np.clip(y[1] / 2e-4, -1.0, 1.0)) + DAMPING_N_S_PER_M * y[1]
        return [y[1], (force(t, y[0], y[1]) - rubbing) / MASS_KG]

    found = solve_ivp(rates, (0.0, time[-1]), [0.0, 0.12], "LSODA", time, max_step=0.01, rtol=1e-6, atol=1e-9)
    forces = np.array([force(*point) for point in zip(time, *found.y, strict=True)])
    position = found.y[0] + 2e-6 * rng.standard_normal(len(time))
    np.savez(path, t=time, u=forces + 0.2 * rng.standard_normal(len(time)), x=position)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    folder = tmp_path_factory.mktemp("slide")
    moved(folder / "run.npz")
    (folder / "slide.yaml").write_text(json.dumps(AXIS), encoding="utf-8")
    axis = load_machine(folder / "slide.yaml", [folder / "run.npz"], to_fit=True)
    return diagnose(axis.signals, axis.model, tolerance=0.05, seed=0, without=OTHERS, wording=axis.wording)


def test_both_are_named_with_their_numbers(found: Diagnosis) -> None:
    """Fails when a law of dry friction that grows with the speed stands for both, or takes a part of the drag."""
    print(found.verdict, [(each.effect, each.probability) for each in found.findings])
    assert {each.effect for each in found.findings[:2]} == {"coulomb_friction", "viscous_friction"}
    numbers = {number.key: number.value for finding in found.findings for number in finding.numbers}
    assert numbers["coulomb_friction.force_n"] == pytest.approx(FORCE_N, rel=0.1)
    assert numbers["dynamics.viscous_friction_n_s_per_m"] == pytest.approx(DAMPING_N_S_PER_M, rel=0.15)
