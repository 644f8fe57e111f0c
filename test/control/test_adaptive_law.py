"""The parts of the adaptive law: switches without a jump, dead-band, anti-windup, adaptation, torque limit, contact."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hand_control.declared import OUT, PARAMETERS, S, Settings
from hand_control.law import Law
from hand_control.tuning import gains
from hand_model.description import load_hand
from hand_model.kernel.rows import ROW
from hand_sim.plant import CREEP, PHI, HandPlants, P
from validation.paper.obstacle_rig import close_on_obstacles
from validation.paper.step_rig import RATE_HZ, draw, run_law, run_pid

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
DT_S = 1.0 / RATE_HZ
COUNT = len(HAND.joints)


class Loop:
    """The law on one plant, a tick at a time."""

    def __init__(self, values: dict[str, Any] | None = None, seed: int = 1, error: float = 0.0) -> None:
        self.values = dict(values or {})
        self.law = Law(gains(HAND, Settings.of(HAND, self.values)))
        self.rng = np.random.default_rng(seed)
        self.plants = HandPlants(HAND, draw(HAND, 1, error, self.rng), DT_S)
        self.noise_rad = np.radians(0.02)

    def set(self, **values: Any) -> None:
        self.values |= values
        self.law.change(gains(HAND, Settings.of(HAND, self.values)))

    def tick(self, target_rad: float, limit_nm: float = 0.6) -> Any:
        state = self.plants.state[0]
        still = np.zeros(COUNT)
        angle = state[PHI] + self.noise_rad * self.rng.standard_normal(COUNT)
        limit = np.full(COUNT, limit_nm)
        out = self.law.tick(np.array([np.full(COUNT, target_rad), still, still, limit, angle, state[P]]), DT_S)
        self.plants.advance(out[OUT.pressure][None, None].copy())
        return out

    def run(self, target_rad: float, seconds: float, limit_nm: float = 0.6) -> Any:
        return np.array([self.tick(target_rad, limit_nm).copy() for _ in range(round(seconds * RATE_HZ))])


CHANGES = [
    {"gain_schedule": False},
    {"adaptation": False},
    {"feed_forward": False},
    {"creep_compensation": False},
    {"anti_windup": "back_calculation"},
    {"contact_detection": False},
    {"deadband_pa": 0.0},
    {"response_time_s": 0.2},
    {"kp_nm_per_rad": [0.4], "gain_schedule": False},
]


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: next(iter(change)))
def test_every_switch_is_bumpless(change: dict[str, Any]) -> None:
    """Fails when the command jumps where a part of the law is switched off, or on again."""
    loop = Loop(error=0.1)
    loop.noise_rad = 0.0
    before = loop.run(0.9, 4.0)[-1][OUT.pressure]
    loop.set(**change)
    after = loop.tick(0.9)[OUT.pressure]
    assert np.abs(after - before).max() < 1500.0
    loop.run(0.9, 2.0)
    before = loop.law.out[OUT.pressure].copy()
    loop.set(**{key: next(p.default for p in PARAMETERS if p.name == key) for key in change})
    assert np.abs(loop.tick(0.9)[OUT.pressure] - before).max() < 1500.0


def test_the_dead_band_rests_and_leaves_no_limit_cycle() -> None:
    """Fails when the set-points change at rest, or a limit cycle around the dead-band remains."""
    with_band, without = Loop(error=0.2), Loop({"deadband_pa": 0.0}, error=0.2)
    angles = []
    travel = []
    for loop in (with_band, without):
        loop.run(0.9, 20.0)
        out = loop.run(0.9, 20.0)
        travel.append(np.abs(np.diff(out[:, OUT.pressure], axis=0)).sum(axis=0).mean())
        angles.append(loop.plants.state[0][PHI])
    assert travel[0] < 0.02 * travel[1]
    assert np.degrees(np.abs(angles[0] - 0.9)).max() < 0.5


@pytest.mark.parametrize("kind", ["conditional_integration", "back_calculation"])
def test_neither_anti_windup_winds_up(kind: str) -> None:
    """Fails when a joint that was held back at its torque limit for long overshoots afterwards."""
    loop = Loop({"anti_windup": kind, "adaptation": False})
    loop.run(1.2, 5.0, limit_nm=0.005)
    loop.run(0.3, 3.0)
    angle = loop.plants.state[0][PHI]
    assert np.degrees(np.abs(angle - 0.3)).max() < 1.0


def test_adaptation_learns_in_motion_and_is_frozen_otherwise() -> None:
    """Fails when the map does not approach the plant's in motion, or moves at rest or at the torque limit."""
    rows = slice(S.offset, S.d_viscous + 1)
    loop = Loop(error=0.25, seed=4)
    for target in (0.4, 1.3, 0.4, 1.3, 0.4):
        loop.run(target, 2.0)
    learnt = loop.law.state[rows].copy()
    assert np.abs(learnt).max() > 0.05
    loop.run(0.4, 5.0)
    assert np.array_equal(loop.law.state[rows], learnt)
    loop.run(0.4, 1.0, limit_nm=0.0)
    assert np.abs(loop.law.state[rows] - learnt).max() < 0.05
    loop.set(adaptation=False)
    assert not loop.law.state[rows].any()


def test_the_law_follows_the_creep_of_the_material() -> None:
    """Fails when the creeping ratio in the law leaves that of the plant, or the torque estimate leaves Eq. 11."""
    loop = Loop()
    loop.noise_rad = 0.0
    loop.run(1.2, 30.0)
    state = loop.plants.state[0]
    assert loop.law.state[S.creep] == pytest.approx(state[CREEP], abs=0.01)
    a0, a1, a2, a3, reach = (
        HAND.row(key)
        for key in (
            "statics.a0_nm",
            "statics.a1_nm_per_rad",
            "statics.a2_nm_per_pa",
            "statics.a3_nm_per_pa_rad",
            "material.phi_max_deg",
        )
    )
    loop.set(adaptation=False)
    out = loop.tick(1.2)
    true = a0 + a1 * (state[PHI] - state[CREEP] * reach) + (a2 + a3 * state[PHI]) * state[P]
    assert out[OUT.torque] == pytest.approx(true, abs=1e-3)


def test_torque_mode_gives_the_asked_torque_at_any_angle() -> None:
    """Fails when effort is not the torque in torque mode."""
    parameters = HAND.parameters.copy()
    parameters[ROW["contact.angle_deg"]] = np.radians(np.linspace(20.0, 70.0, COUNT))
    parameters[ROW["contact.stiffness_nm_per_rad"]] = 10.0
    settings = Settings.of(HAND, {"control_mode": "torque"})
    law, plants = Law(gains(HAND, settings)), HandPlants(HAND, parameters[None], DT_S)
    zero, wanted = np.zeros(COUNT), np.full(COUNT, 0.12)
    for _ in range(800):
        state = plants.state[0]
        out = law.tick(np.array([zero, zero, zero, wanted, state[PHI], state[P]]), DT_S)
        plants.advance(out[OUT.pressure][None, None].copy())
    assert out[OUT.torque] == pytest.approx(wanted, rel=0.02)


def test_steps_on_wrong_plants_beat_a_fixed_pid() -> None:
    """Fails when adaptation no longer halves the error of a good fixed PID on plants 30 % off, or overshoots."""
    rng = np.random.default_rng(11)
    plants = draw(HAND, 6, 0.3, rng)
    settings = Settings.of(HAND, {})
    ours = run_law(HAND, plants, settings, 5)
    gains_pid = np.repeat(np.array([[1.0e6], [2.8e7], [2.4e4], [1.6e-3]]), ours.angle.shape[1], axis=1)
    fixed = run_pid(HAND, plants, settings, gains_pid, 5)
    print("seed 11, 5", ours.rms_deg.mean(), fixed.rms_deg.mean(), ours.overshoot.max())
    assert ours.rms_deg.mean() < 0.5 * fixed.rms_deg.mean()
    assert ours.overshoot.max() < 0.05
    assert ours.travel_pa.mean() < fixed.travel_pa.mean()


def test_torque_and_contact_at_an_obstacle() -> None:
    """Fails when an identified joint holds another torque than its limit, goes far above it, or reports no contact."""
    settings = Settings.of(HAND, {})
    trial = close_on_obstacles(HAND, 8, settings, seed=6)
    there = ~np.isnan(trial.met) & trial.able
    ratio = (trial.held / trial.limit)[there]
    print("seed 6", ratio.min(), ratio.max())
    assert np.quantile(np.abs(ratio - 1.0), 0.98) < 0.10
    assert (trial.peak / trial.limit)[there].max() < 1.15
    assert np.isnan(trial.by_model[there]).mean() < 0.02
    assert np.nanmedian((trial.by_model - trial.met)[there]) < 0.2
    free = close_on_obstacles(HAND, 8, settings, seed=7, obstacle=False)
    assert (~np.isnan(free.by_model)).mean() < 0.05


def test_contact_ends_where_the_torque_goes() -> None:
    """Fails when a joint stays in contact after its obstacle is gone."""
    parameters = HAND.parameters.copy()
    parameters[ROW["contact.angle_deg"]] = np.radians(40.0)
    parameters[ROW["contact.stiffness_nm_per_rad"]] = 5.0
    loop = Loop({"adaptation": False})
    loop.noise_rad = 0.0
    loop.plants = HandPlants(HAND, parameters[None], DT_S)
    assert loop.run(1.2, 2.0, 0.1)[-1][OUT.contact].all()
    assert not loop.run(0.3, 2.0, 0.1)[-1][OUT.contact].any()
