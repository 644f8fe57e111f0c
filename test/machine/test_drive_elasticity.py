"""A spring between drive and load, with and without play, on an independent plant of two inertias."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hand_diagnosis.diagnosis import Diagnosis, diagnose
from hand_machine.machine import Machine, load_machine
from hand_model.effects import CATALOGUE

DRIVE, LOAD, DAMPING, SPRING = 0.012, 0.018, 0.25, 2.0
"""Inertias before and behind the spring [kg m^2], damping of the drive [N m s/rad], spring on the drive [N m/rad]."""
STIFFNESS, LOSS = 25.0, 0.03
"""Of the shaft [N m/rad, N m s/rad]."""
TRIED = {
    *("coulomb_friction", "viscous_friction", "directional_friction", "gear_friction", "constant_load", "stiffening"),
    *("spring", "drive_gain", "drive_lag", "command_delay", "added_inertia", "backlash", "drive_elasticity"),
    *("hysteresis", "angle_lag", "drive_saturation"),
}
OTHERS = [effect.name for effect in CATALOGUE if effect.name not in TRIED]
DECOYS = TRIED - {"drive_elasticity", "backlash"}
AXIS: dict[str, Any] = {
    "schema": 1,
    "name": "axis",
    "motion": "rotary",
    "gain": 1.02,
    "stiffness": 0.98 * SPRING,
    "damping": 1.03 * DAMPING,
    "inertia": 0.97 * (DRIVE + LOAD),
    "has": ["motor"],
    "columns": {"time": {"column": "t"}, "input": {"column": "u"}, "position": {"column": "x"}},
}


def machine(folder: Path, gap_rad: float, seed: int, *, at_load: bool = False, rigid: bool = False) -> Machine:
    """The axis and a recording of it at 250 Hz, by an integrator of scipy."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    time, knots = np.arange(0.0, 16.0, 0.004), np.arange(0.0, 16.5, 0.4)
    command = np.interp(time, knots, rng.uniform(-1.2, 1.2, len(knots))) + 0.5 * np.sign(np.sin(2.2 * time))
    command[time < 0.2] = 0.0

    def rates(t: float, y: np.ndarray) -> list[float]:
        driving = float(np.interp(t, time, command)) - DAMPING * y[1] - SPRING * y[0]
        if rigid:
            return [y[1], driving / (DRIVE + LOAD), y[1], driving / (DRIVE + LOAD)]
        ahead = y[2] - y[0]
        wound = ahead - float(np.clip(ahead, -0.5 * gap_rad, 0.5 * gap_rad))
        shaft = STIFFNESS * wound + (LOSS * (y[3] - y[1]) if wound != 0.0 or gap_rad == 0.0 else 0.0)
        return [y[1], (driving + shaft) / DRIVE, y[3], -shaft / LOAD]

    found = solve_ivp(rates, (0.0, time[-1]), np.zeros(4), "LSODA", time, max_step=2e-3, rtol=1e-7, atol=1e-9)
    angle = found.y[2 if at_load else 0] + 2e-4 * rng.standard_normal(len(time))
    np.savez(folder / "run.npz", t=time, u=command, x=angle)
    (folder / "axis.yaml").write_text(json.dumps(AXIS), encoding="utf-8")
    return load_machine(folder / "axis.yaml", [folder / "run.npz"], to_fit=True)


def diagnosed(axis: Machine) -> Diagnosis:
    return diagnose(axis.signals, axis.model, tolerance=0.05, seed=0, without=OTHERS, wording=axis.wording)


@pytest.mark.parametrize(("gap_deg", "at_load"), [(0.0, False), (0.0, True), (3.0, False)])
def test_an_elastic_shaft_is_named_first(tmp_path: Path, gap_deg: float, at_load: bool) -> None:
    """Fails when another effect is named first, a decoy is believed, or frequency, share, side or play are wrong."""
    found = diagnosed(machine(tmp_path, np.radians(gap_deg), 5, at_load=at_load))
    assert found.findings, found.verdict
    assert found.findings[0].effect == "drive_elasticity"
    assert not {finding.effect for finding in found.findings if finding.probability > 0.5} & DECOYS
    numbers = {number.key.partition(".")[2]: number.value for number in found.findings[0].numbers}
    assert numbers["frequency_hz"] == pytest.approx(np.sqrt(STIFFNESS / LOAD) / (2.0 * np.pi), rel=0.05)
    assert numbers["share"] == pytest.approx(LOAD / (DRIVE + LOAD), abs=0.04)  # the ratio of both within 20 %
    assert numbers["inertia_kg_m2"] == pytest.approx(DRIVE, rel=0.1)
    assert numbers["gap_deg"] == pytest.approx(gap_deg, abs=0.3)
    assert numbers["at_load"] == pytest.approx(float(at_load), abs=0.1)


def test_no_spring_is_found_where_the_shaft_is_rigid(tmp_path: Path) -> None:
    """Fails when noise or wrong nominal numbers are taken for an elastic shaft."""
    assert diagnosed(machine(tmp_path, 0.0, 6, rigid=True)).findings == ()
