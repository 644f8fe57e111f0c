"""Recordings that do not belong to their machine file are refused in one line that says what is wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hand_machine.machine import Machine, load_machine
from hand_model.effects.effect import ATMOSPHERE_PA
from hand_model.yaml_loader import DescriptionError
from hand_recording.recording_files import RecordingError

AREA_M2, STIFFNESS, DAMPING, MASS = 1e-3, 3000.0, 40.0, 1.5
CYLINDER: dict[str, Any] = {
    "schema": 1,
    "name": "cylinder",
    "motion": "linear",
    "gain": AREA_M2,
    "stiffness": STIFFNESS,
    "damping": DAMPING,
    "inertia": MASS,
    "columns": {"time": {"column": "t"}, "input": {"column": "p"}, "position": {"column": "x"}},
}


def save(path: Path, seed: int = 1, *, friction: float = 0.0, load: float = 0.0, **numbers: float) -> None:
    """A cylinder against a spring, by scipy.integrate.solve_ivp. load: constant force [N]; friction: Coulomb [N]."""
    stiffness, damping, mass = (
        numbers.get(key, usual) for key, usual in (("stiffness", STIFFNESS), ("damping", DAMPING), ("mass", MASS))
    )
    rng = np.random.default_rng(seed)
    knots = np.arange(0.0, 11.0, 0.35)
    levels = np.where(rng.uniform(size=len(knots)) < 0.3, 0.0, rng.uniform(0.0, 1.5e5, len(knots)))
    times = np.arange(0.0, 10.0, 0.005)

    def slope(t: float, y: np.ndarray) -> list[float]:
        force = AREA_M2 * np.interp(t, knots, levels) - stiffness * y[0] - damping * y[1] - load
        return [y[1], (force - friction * np.tanh(y[1] / 1e-3)) / mass]

    x = solve_ivp(slope, (0.0, 10.0), [0.0, 0.0], "LSODA", times, rtol=1e-7, atol=1e-9, max_step=0.02).y[0]
    pressure = np.interp(times, knots, levels)
    np.savez(path, t=times, p=pressure, absolute=pressure + ATMOSPHERE_PA, x=x + 2e-6 * rng.standard_normal(len(x)))


def load(folder: Path, *names: str, **keys: object) -> Machine:
    (folder / "machine.yaml").write_text(json.dumps(CYLINDER | keys), encoding="utf-8")
    return load_machine(folder / "machine.yaml", [folder / name for name in names or ("run.npz",)])


def columns(**of_input: object) -> dict[str, Any]:
    return {**CYLINDER["columns"], "input": of_input}


def test_an_absolute_pressure_is_refused_unless_it_is_stated(tmp_path: Path) -> None:
    """Fails when absolute pressures are taken for gauge in silence, or a stated one is not converted."""
    save(tmp_path / "run.npz")
    with pytest.raises(RecordingError, match=r"absolute pressure.*columns.input.pressure: absolute") as refused:
        load(tmp_path, columns=columns(column="absolute"))
    assert "\n" not in str(refused.value)
    stated = load(tmp_path, columns=columns(column="absolute", pressure="absolute"))
    gauge = load(tmp_path, columns=columns(column="p", pressure="gauge"))
    assert np.allclose(stated.signals[0].pressure_pa, gauge.signals[0].pressure_pa)
    load(tmp_path, columns=columns(column="absolute", pressure="gauge"))
    with pytest.raises(DescriptionError, match="pressure is 'abs'; it must be one of gauge, absolute"):
        load(tmp_path, columns=columns(column="p", pressure="abs"))


def test_a_constant_load_is_no_absolute_pressure(tmp_path: Path) -> None:
    """Fails when a load as large as the force of the atmosphere is refused though the pressure is vented to 0."""
    save(tmp_path / "run.npz", load=-AREA_M2 * ATMOSPHERE_PA)
    load(tmp_path)


@pytest.mark.parametrize("other", [{"stiffness": 20000.0, "mass": 12.0}, {"stiffness": 400.0, "damping": 400.0}])
def test_a_recording_of_another_machine_is_refused(tmp_path: Path, other: dict[str, Any]) -> None:
    """Fails when a recording of a machine with other numbers is diagnosed as physics."""
    save(tmp_path / "run.npz", 1, **other)
    with pytest.raises(
        RecordingError, match=r"seems to be of another machine than machine.yaml.*instead of"
    ) as refused:
        load(tmp_path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("inertia", "fits"), [(MASS, True), (10.0 * MASS, True), (400.0 * MASS, False)])
def test_a_force_far_below_what_the_motion_needs_is_refused(tmp_path: Path, inertia: float, fits: bool) -> None:
    """Fails when the recording of a light machine passes for that of a heavy one because friction hides it."""
    time = np.arange(0.0, 10.0, 0.005)
    x, v, a = 0.02 * np.sin(6.0 * time), 0.12 * np.cos(6.0 * time), -0.72 * np.sin(6.0 * time)
    np.savez(tmp_path / "run.npz", t=time, x=x, f=-MASS * a - 5.0 * np.sign(v))
    parts = {"time": {"column": "t"}, "position": {"column": "x"}, "force": {"column": "f"}}
    rig = {"imposed": True, "gain": 1.0, "stiffness": 0.0, "damping": 0.0, "inertia": inertia, "columns": parts}
    if fits:
        load(tmp_path, **rig)
        return
    with pytest.raises(RecordingError, match=r"the model needs .* times the measured force.*of the machine that"):
        load(tmp_path, **rig)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "effects",
    [{}, {"friction": 15.0}, {"damping": 400.0}, {"mass": 3.0, "stiffness": 4500.0}, {"load": 30.0, "friction": 8.0}],
)
def test_missing_physics_is_no_other_machine(tmp_path: Path, seed: int, effects: dict[str, float]) -> None:
    """Fails when an effect or a wrong number that the diagnosis can find is refused as another machine."""
    save(tmp_path / "run.npz", seed, **effects)
    load(tmp_path)


def test_exchanged_loads_are_refused(tmp_path: Path) -> None:
    """Fails when the loads of two recordings are exchanged and no line says so, or right ones are refused."""
    save(tmp_path / "empty.npz", 1)
    save(tmp_path / "loaded.npz", 2, mass=3.0 * MASS, friction=2.0)
    names = ("empty.npz", "loaded.npz")
    load(tmp_path, *names, recordings={"loaded.npz": {"added_inertia": 2.0 * MASS}})
    with pytest.raises(
        RecordingError, match=r"loaded.npz and empty.npz seem to be swapped.*under recordings"
    ) as refused:
        load(tmp_path, *names, recordings={"empty.npz": {"added_inertia": 2.0 * MASS}})
    assert "\n" not in str(refused.value)
