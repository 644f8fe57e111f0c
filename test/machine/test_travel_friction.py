"""Friction that varies over the travel, on a rig of its own in closed form: found there, and none where there is none.

A rig moves a cylinder to and fro at constant pressure and measures its force. The friction of the plant is a level with
a part in proportion to the pressure, times a curve over the position that is not the one of the tool: a hyperbola, as
of a bore that widens. The recordings are closed expressions of the time.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from hand_diagnosis.diagnosis import Diagnosis, diagnose
from hand_machine.machine import Machine, load_machine
from hand_model.effects import CATALOGUE

AREA_M2, STROKE_M, PERIOD_S, SPEED_M_S = 5e-4, 0.04, 0.01, 0.012
LEVEL_N, PER_BAR_N, NOISE_N = 3.0, 1.0, 0.12
TRIED = {"coulomb_friction", "viscous_friction", "directional_friction", "stiffening", "constant_load", "hysteresis"}
OTHERS = [effect.name for effect in CATALOGUE if effect.name not in TRIED]
RIG = {
    "schema": 1,
    "name": "bore",
    "motion": "linear",
    "imposed": True,
    "gain": 1.02 * AREA_M2,
    "inertia": 0.1,
    "columns": {
        "time": {"column": "t"},
        "input": {"column": "p"},
        "position": {"column": "x"},
        "force": {"column": "f"},
    },
}
BARS = (1.0, 4.0, 7.0)


def over_travel(x: np.ndarray, share: float) -> np.ndarray:
    """Relative friction at the position x [m]: 1 at 0, 1 - share at the end of the stroke, most of it early."""
    way = x / STROKE_M
    return 1.0 - share * 1.5 * way / (0.5 + way)


def machine(folder: Path, share: float, seed: int) -> Machine:
    """Recordings of the rig at three pressures: a triangle in time with rounded ends, and white noise of the force."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    names = []
    for bar in BARS:
        time = np.arange(0.0, 32.0, PERIOD_S)
        turn = np.pi * SPEED_M_S / STROKE_M
        smooth = np.arcsin(0.999 * np.sin(turn * time)) / np.arcsin(0.999)  # -1 to 1
        x = 0.5 * STROKE_M * (1.0 + smooth)
        speed = np.gradient(x, PERIOD_S)
        level = (LEVEL_N + PER_BAR_N * bar) * over_travel(x, share)
        force = AREA_M2 * 1e5 * bar - level * np.tanh(speed / 2e-4) - 0.1 * np.gradient(speed, PERIOD_S)
        names.append(folder / f"run_{bar:g}bar.npz")
        measured = force + NOISE_N * rng.standard_normal(len(time))
        pressure = 1e5 * bar + 200.0 * rng.standard_normal(len(time))
        np.savez(names[-1], t=time, p=pressure, x=x + 2e-6 * rng.standard_normal(len(time)), f=measured)
    (folder / "rig.yaml").write_text(json.dumps(RIG), encoding="utf-8")
    return load_machine(folder / "rig.yaml", names, to_fit=True)


def diagnosed(axis: Machine) -> Diagnosis:
    return diagnose(axis.signals, axis.model, tolerance=0.1, seed=0, without=OTHERS, wording=axis.wording)


@pytest.mark.parametrize("share", [0.35, -0.35])
def test_friction_over_the_travel_is_found_in_size_and_sign(tmp_path: Path, share: float) -> None:
    """Fails when friction is not named first, its change over the travel is missed, of the wrong size or sign, or a
    decoy is believed."""
    found = diagnosed(machine(tmp_path, share, 31))
    assert found.findings[0].effect == "coulomb_friction"
    assert not {f.effect for f in found.findings if f.probability > 0.5} & {"stiffening", "viscous_friction"}
    law = found.findings[0].law
    assert law is not None and law.travel is not None
    x, size, low, high, _ = law.travel.points.T
    truth = 100.0 * over_travel(x, share)
    assert law.travel.over_unit == "m"
    assert size / size[0] == pytest.approx(truth / truth[0], abs=0.07)
    assert np.all(low <= size) and np.all(size <= high)
    assert ("its size falls" in law.statement) == (share > 0.0)


def test_no_change_over_the_travel_is_claimed_where_there_is_none(tmp_path: Path) -> None:
    """Fails when noise or wrong nominal numbers are taken for friction that changes over the travel."""
    found = diagnosed(machine(tmp_path, 0.0, 41))
    assert found.findings[0].effect == "coulomb_friction"
    law = found.findings[0].law
    assert law is not None and law.travel is None
