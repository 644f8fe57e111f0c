"""The window over which a motion is differentiated follows its noise and its bandwidth."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from hand_identification.joint_data import joint_problem
from hand_machine.derivative_window import derivative_window_s
from hand_machine.machine import load_machine
from hand_machine.settings import MACHINE
from hand_recording.signals import derivatives

PERIOD_S = 0.004


def moved(hertz: float, noise_m: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Positions [m] with noise, and their acceleration without it [m/s^2], of a sum of sines up to a frequency."""
    time = np.arange(0.0, 20.0, PERIOD_S)
    rates = 2.0 * np.pi * hertz * np.array([0.31, 0.57, 1.0])
    waves = np.sin(np.outer(rates, time))
    position = 0.05 * (waves / rates[:, None] ** 2).sum(axis=0) * rates[-1] ** 2
    acceleration = -0.05 * waves.sum(axis=0) * rates[-1] ** 2
    return position + noise_m * np.random.default_rng(seed).standard_normal(len(time)), acceleration


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("hertz", "noise_m"), [(12.0, 1e-6), (12.0, 1e-4), (3.0, 1e-5), (1.0, 1e-4), (0.5, 1e-3)])
def test_the_acceleration_is_nearly_as_good_as_with_the_best_window(hertz: float, noise_m: float, seed: int) -> None:
    """Fails when the window is constant, ignores the noise, or ignores what the motion does within it."""
    position, truth = moved(hertz, noise_m, seed)

    def error(window_s: float) -> float:
        found = derivatives(position[:, None], PERIOD_S, window_s)[1][:, 0]
        return float(np.sqrt(np.mean((found - truth)[100:-100] ** 2)))

    best = min(error(2.0 * half * PERIOD_S) for half in range(2, int(MACHINE.longest_window_s / PERIOD_S / 2.0)))
    assert error(derivative_window_s(position, PERIOD_S)) < 1.4 * best


def test_a_fast_axis_gets_a_shorter_window_than_a_slow_one() -> None:
    """Fails when bandwidth or noise has no influence; quiet readings at rest must not divide by zero."""
    fast, slow = (derivative_window_s(moved(hertz, 1e-4)[0], PERIOD_S) for hertz in (12.0, 0.7))
    assert 2.0 * fast < slow <= MACHINE.longest_window_s
    quiet, noisy = (derivative_window_s(moved(3.0, noise_m)[0], PERIOD_S) for noise_m in (1e-6, 1e-3))
    assert 2.0 * quiet < noisy
    assert derivative_window_s(np.zeros(100), PERIOD_S) == pytest.approx(4.0 * PERIOD_S)
    assert derivative_window_s(np.arange(6.0), PERIOD_S) == pytest.approx(4.0 * PERIOD_S)


def rig(folder: Path, position: np.ndarray, force: np.ndarray) -> Path:
    """A recording of a mass that a rig moves, and its machine file."""
    columns = {"time": {"column": "t"}, "position": {"column": "x"}, "force": {"column": "f"}}
    file = {"schema": 1, "name": "rig", "motion": "linear", "imposed": True, "inertia": 2.0, "columns": columns}
    (folder / "rig.yaml").write_text(json.dumps(file), encoding="utf-8")
    np.savez(folder / "run.npz", t=PERIOD_S * np.arange(len(position)), x=position, f=force)
    return folder / "rig.yaml"


@pytest.mark.parametrize("seed", range(2))
def test_the_measured_force_chooses_the_window_of_a_fit(seed: int, tmp_path: Path) -> None:
    """Fails when noise in bursts, which the position alone hides, leaves the window too short; or a prediction sees the
    force that it predicts. Random: see the seed."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    clean, acceleration = moved(3.0, 0.0)
    bursts = np.repeat(rng.random(len(clean) // 25) < 0.05, 25)
    position = clean + np.where(bursts, 1e-3, 1e-6) * rng.standard_normal(len(clean))
    machine_file = rig(tmp_path, position, -2.0 * acceleration)
    fitted = load_machine(machine_file, [tmp_path / "run.npz"], to_fit=True)
    predicted = load_machine(machine_file, [tmp_path / "run.npz"])
    read = fitted.wording.units.per_angle * fitted.signals[0].angle_rad

    def error(window_s: float) -> float:
        found = derivatives(read, PERIOD_S, window_s)[1][:, 0]
        return float(np.sqrt(np.mean((found - acceleration)[100:-100] ** 2)))

    assert error(fitted.signals[0].derivative_s) < 0.3 * error(predicted.signals[0].derivative_s)
    assert fitted.signals[0].band_s == fitted.signals[0].derivative_s == fitted.description.derivative_window_s
    assert predicted.signals[0].band_s == 0.0
    assert predicted.description.derivative_window_s is None


def test_measured_and_predicted_force_are_smoothed_alike(tmp_path: Path) -> None:
    """Fails when a ripple that the motion cannot show counts as an error, or only one side is smoothed."""
    position, acceleration = moved(1.0, 1e-5)
    ripple = 30.0 * np.sin(2.0 * np.pi * 60.0 * PERIOD_S * np.arange(len(position)))
    machine_file = rig(tmp_path, position, ripple - 2.0 * acceleration)
    machine_file.write_text(json.dumps(json.loads(machine_file.read_text()) | {"derivative_window": 0.2}))
    left = {}
    for to_fit in (True, False):
        machine = load_machine(machine_file, [tmp_path / "run.npz"], to_fit=to_fit)
        problem = joint_problem(machine.signals, machine.model, "axis")
        residual = problem.residuals(*problem.columns([], np.zeros((1, 0))))[0][0, 2]
        force_n = machine.wording.signal_units[2][0]
        left[to_fit] = force_n * float(np.sqrt(np.mean(residual[problem.segments[0].use[2]] ** 2)))
    assert left[False] == pytest.approx(30.0 / np.sqrt(2.0), rel=0.05)
    assert left[True] < 0.1 * left[False]


def test_the_force_of_an_imposed_motion_is_predicted_with_this_window(tmp_path: Path) -> None:
    """Fails when the diagnosis differentiates a machine's motion over a constant window, or its end is evaluated."""
    position, acceleration = moved(8.0, 1e-6)
    rig(tmp_path, position, -2.0 * acceleration)
    machine = load_machine(tmp_path / "rig.yaml", [tmp_path / "run.npz"])
    problem = joint_problem(machine.signals, machine.model, "axis")
    columns_, starts = problem.columns([], np.zeros((1, 0)))
    predicted = problem.predict(columns_, starts)[0][0, 2]
    segment = problem.segments[0]
    left = (predicted - segment.force_n)[segment.use[2]]
    assert np.sqrt(np.mean(left**2)) < 0.02 * np.std(segment.force_n)
    assert segment.use[2].sum() > 4000
    assert not segment.use[2][-2:].any()
