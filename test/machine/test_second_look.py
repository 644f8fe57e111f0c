"""How sure the numbers of a machine are, on a rig in closed form: by the errors of the model that was found.

Dry friction that the nominal model lacks keeps its sign for seconds, so that the errors of that model correlate over
seconds, although the noise of the force is white. The rig moves the axis as a sum of sines; it shares no code with the
tool.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from hand_diagnosis.diagnosis import Diagnosis
from hand_machine.machine import load_machine
from test.machine import loaded

PERIOD_S, SECONDS, FRICTION_N, NOISE_N = 0.01, 20.0, 3.0, 1.5
TRIED = ("coulomb_friction", "viscous_friction", "spring", "hysteresis")
RIG = {
    "schema": 1,
    "name": "slide",
    "motion": "linear",
    "imposed": True,
    "inertia": 0.1,
    "columns": {"time": {"column": "t"}, "position": {"column": "x"}, "force": {"column": "f"}},
}


def diagnosed(folder: Path, wave_n: float, seed: int) -> Diagnosis:
    """A diagnosis of friction under white noise, or under a slow wave of the force that nothing explains."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, SECONDS, PERIOD_S)
    x = 0.02 * np.sin(1.3 * t) + 0.01 * np.sin(3.1 * t + 1.0)
    speed = 0.026 * np.cos(1.3 * t) + 0.031 * np.cos(3.1 * t + 1.0)
    wave = sum(np.sin(2.0 * np.pi * hertz * t + rng.uniform(0.0, 6.0)) for hertz in (0.13, 0.29, 0.47, 0.71))
    noise = wave_n * wave if wave_n else NOISE_N * rng.standard_normal(len(t))
    force = -FRICTION_N * np.tanh(speed / 1e-3) + noise
    np.savez(folder / "run.npz", t=t, x=x, f=force)
    (folder / "rig.yaml").write_text(json.dumps(RIG), encoding="utf-8")
    axis = load_machine(folder / "rig.yaml", [folder / "run.npz"], to_fit=True)
    return loaded.diagnosed(axis, *TRIED)


def test_white_noise_counts_as_white_once_friction_is_found(tmp_path: Path) -> None:
    """Fails when the friction that the nominal model lacks makes its own number uncertain, or the number is wrong, or
    when noise of the smoothed force counts as other physics.
    """
    found = diagnosed(tmp_path, 0.0, 61)
    assert found.joints[0].search.problem.correlation_s < 0.1
    assert not found.remainder
    assert found.findings[0].effect == "coulomb_friction"
    assert found.findings[0].probability > 0.5
    number = next(n for n in found.findings[0].numbers if n.key == "coulomb_friction.force_n")
    assert number.std < 0.03 * FRICTION_N
    assert abs(number.value - FRICTION_N) < 3.0 * number.std


@pytest.mark.parametrize("seed", [62, 63])
def test_a_slow_error_stays_correlated(tmp_path: Path, seed: int) -> None:
    """Fails when samples of an error that changes within seconds count as independent."""
    found = diagnosed(tmp_path, 0.75, seed)
    assert found.joints[0].search.problem.correlation_s > 0.3
