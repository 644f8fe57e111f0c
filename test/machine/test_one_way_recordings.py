"""Recordings of one machine that move in one direction each: a direction that only one shows is not left out."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hand_diagnosis.found_machine import write_machine_model
from hand_diagnosis.judgement.findings import in_order
from hand_diagnosis.judgement.left_out import covered
from hand_diagnosis.report import document
from hand_identification.joint_data import joint_problem
from hand_machine.machine import load_machine
from test.machine.loaded import diagnosed, errors, load

PERIOD_S, NOISE_RAD = 0.01, 1e-3
DRAG, INERTIA, FRICTION = 0.3, 0.03, {1: 0.6, -1: 0.05}
WHEEL: dict[str, Any] = {
    "schema": 1,
    "name": "wheel",
    "motion": "rotary",
    "gain": {"value": 1.0, "exact": True},
    "stiffness": {"value": 0.0, "exact": True},
    "damping": {"value": DRAG, "tolerance": 0.1},
    "inertia": {"value": INERTIA, "tolerance": 0.2},
    "columns": {"time": {"column": "t"}, "input": {"column": "u"}, "position": {"column": "q"}},
}


def turn(path: Path, seed: int, *ways: int, steep: float = 1.0) -> None:
    """A wheel that turns freely under rising torques in these directions in turn, by scipy.integrate.solve_ivp."""
    rng = np.random.default_rng(seed)
    each_s = 8.0
    times = np.arange(0.0, each_s * len(ways), PERIOD_S)
    rise = np.clip(times % each_s, 0.0, 6.0) * (times % each_s < 7.0)
    torque = np.array(ways)[(times // each_s).astype(int)] * steep * rise

    def slope(t: float, y: np.ndarray) -> list[float]:
        friction = FRICTION[1] if y[1] > 0.0 else FRICTION[-1]
        pushed = float(np.interp(t, times, torque))
        return [y[1], (pushed - DRAG * y[1] - friction * np.tanh(y[1] / 0.01)) / INERTIA]

    q = solve_ivp(slope, (0.0, times[-1]), [0.0, 0.0], "LSODA", times, rtol=1e-7, atol=1e-9, max_step=0.02).y[0]
    np.savez(path, t=times, u=torque, q=q + NOISE_RAD * rng.standard_normal(len(times)))


@pytest.mark.parametrize(
    ("ways", "alone"),
    [
        (((1,), (-1,)), ["a.npz", "b.npz"]),
        (((1,), (1,), (-1,)), ["c.npz"]),
        (((1, -1), (1,), (-1,)), []),
        (((1, -1), (1,), (1,)), ["a.npz"]),
    ],
)
def test_a_direction_of_one_recording_alone_is_not_left_out(
    tmp_path: Path, ways: tuple[tuple[int, ...], ...], alone: list[str]
) -> None:
    """Fails when a recording is predicted from others that never move in its direction, or one that could be is not."""
    names = ["a.npz", "b.npz", "c.npz"][: len(ways)]
    for seed, (name, own) in enumerate(zip(names, ways, strict=True)):
        turn(tmp_path / name, seed, *own)
    machine = load(tmp_path, WHEEL, *names)
    segments = joint_problem(machine.signals, machine.model, "axis").segments
    tested = covered(segments)
    assert [name for k, name in enumerate(names) if k not in tested] == alone


def test_a_finer_form_comes_after_what_it_refines() -> None:
    """Fails when friction by direction stands before the friction that it refines, or others change their places."""

    def finding(effect: str, explains: float, signal: str = "angle") -> Any:
        return SimpleNamespace(effect=effect, signal=signal, explains=explains)

    found = [finding("directional_friction", 0.6), finding("leak", 0.1, "pressure"), finding("coulomb_friction", 0.3)]
    assert [each.effect for each in in_order(found)] == ["coulomb_friction", "leak", "directional_friction"]
    alone = [finding("stiffening", 0.3), finding("directional_friction", 0.6)]
    assert [each.effect for each in in_order(alone)] == ["directional_friction", "stiffening"]


def test_friction_of_each_direction_is_kept_and_predicts_others(tmp_path: Path) -> None:
    """Fails when a recording back is to be predicted from one forward, or what was found does not hold on others."""
    turn(tmp_path / "a.npz", 1, 1)
    turn(tmp_path / "b.npz", 2, -1)
    turn(tmp_path / "c.npz", 3, -1, 1, steep=0.7)
    machine = load(tmp_path, WHEEL, "a.npz", "b.npz")
    result = diagnosed(machine, "coulomb_friction", "directional_friction", "viscous_friction")
    report = document(result, ["a.npz", "b.npz"], "machine.yaml")
    assert report["withdrawn"] == report["left_out"] == []
    for name in ("a.npz", "b.npz"):
        assert any(f"{name} moves in a direction in which no other" in line for line in report["data_check"])
    assert {finding["effect"] for finding in report["findings"]} & {"coulomb_friction", "directional_friction"}
    write_machine_model(result, machine.description, ["a.npz", "b.npz"], tmp_path / "model.yaml")
    (before,) = errors(load(tmp_path, WHEEL, "c.npz"))
    (after,) = errors(load_machine(tmp_path / "model.yaml", [tmp_path / "c.npz"]))
    assert after < 0.2 * before
