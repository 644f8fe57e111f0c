"""The shaped reference: within its limits for any target and any sequence of steps, and where it comes to rest."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hand_control.declared import C, Settings, bounded_dt
from hand_control.shaping import Shaper, TorqueLimiter, approach_speed
from hand_model.description import load_hand

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
LOW, HIGH = np.array([-0.2]), np.array([1.7])
ODD_STEPS = (0.0, -1.0, math.nan, math.inf, -math.inf, 1e38, 3.0, 1e-9)
ODD_VALUES = (math.nan, math.inf, -math.inf, 1e30, -1e30, 1e3)
DT_S = 0.005


def settings_of(**values: Any) -> Settings:
    return Settings.of(HAND, values)


def bounded(position: float = 0.0) -> Shaper:
    shaper = Shaper(1, None, (LOW, HIGH))
    shaper.latch(np.array([position]))
    return shaper


def drawn(rng: np.random.Generator) -> Settings:
    """Limits between slow and hardly any."""
    speed, most, bandwidth = np.exp(rng.uniform(np.log([1.0, 100.0, 1.0]), np.log([2000.0, 1e6, 100.0])))
    return settings_of(
        max_speed_deg_per_s=float(speed),
        max_acceleration_deg_per_s2=float(most),
        reference_bandwidth_rad_per_s=float(bandwidth),
    )


@pytest.mark.parametrize("seed", range(40))
def test_no_command_moves_the_reference_out_of_its_limits(seed: int) -> None:
    """Fails when any target, target speed or step length takes angle, speed or acceleration beyond its limit."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    chosen, shaper = drawn(rng), bounded(rng.uniform(-0.2, 1.7))
    fastest, most = math.radians(chosen.max_speed_deg_per_s), math.radians(chosen.max_acceleration_deg_per_s2)
    target = speed = 0.0
    reached = np.zeros(2)
    for _ in range(3000):
        if rng.random() < 0.05:
            target = float(rng.choice(ODD_VALUES) if rng.random() < 0.2 else rng.uniform(-0.4, 1.9))
            speed = float(rng.choice(ODD_VALUES) if rng.random() < 0.2 else rng.normal(0.0, 30.0))
        dt = float(rng.choice(ODD_STEPS) if rng.random() < 0.05 else rng.choice([DT_S, 0.001, rng.uniform(0, 0.06)]))
        before_r, before_v = shaper.r[0], shaper.v[0]
        shaper.step(np.array([target]), np.array([speed]), chosen, dt)
        r, v, step = shaper.r[0], shaper.v[0], bounded_dt(dt)
        assert LOW[0] <= r <= HIGH[0]
        assert abs(v) <= fastest * (1.0 + 1e-9)
        assert abs(r - before_r) <= fastest * step * (1.0 + 1e-9) + 1e-12
        assert abs(v - before_v) <= most * step * (1.0 + 1e-6) + 1e-9
        assert abs(shaper.a[0]) <= most * (1.0 + 1e-6) + 1e-9 / max(step, 1e-3)
        reached = np.maximum(reached, [abs(v) / fastest, abs(v - before_v) / (most * step) if step > 1e-4 else 0.0])
    assert reached.max() > 0.99  # a limit of speed or acceleration was reached, not only kept


@pytest.mark.parametrize("seed", range(10))
def test_limits_lowered_in_motion_never_move_the_reference_beyond_the_joint(seed: int) -> None:
    """Fails when a lower acceleration or speed limit in mid-motion takes the reference beyond the joint's range."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    shaper = bounded()
    for _ in range(200):
        chosen, target = drawn(rng), rng.uniform(-0.2, 1.7)
        for _ in range(20):
            shaper.step(np.array([target]), np.array([rng.normal(0.0, 20.0)]), chosen, DT_S)
            assert LOW[0] <= shaper.r[0] <= HIGH[0]


def test_a_lower_speed_limit_is_approached_at_the_largest_acceleration() -> None:
    """Fails when a lower speed limit makes the speed of the reference jump."""
    shaper, fast = bounded(), settings_of(max_speed_deg_per_s=400.0)
    while shaper.v[0] < math.radians(390.0):
        shaper.step(HIGH, np.zeros(1), fast, 0.001)
    slow, speeds = settings_of(max_speed_deg_per_s=100.0, max_acceleration_deg_per_s2=5000.0), [shaper.v[0]]
    for _ in range(100):
        shaper.step(HIGH, np.zeros(1), slow, 0.001)
        speeds.append(shaper.v[0])
    assert np.min(np.diff(speeds)) == pytest.approx(-math.radians(5000.0) * 0.001)
    assert speeds[-1] <= math.radians(100.0)


@pytest.mark.parametrize("most_deg", [200.0, 1000.0, 15000.0])
@pytest.mark.parametrize("dt", [0.001, DT_S, 0.05])
def test_a_step_arrives_without_overshoot_at_any_acceleration(most_deg: float, dt: float) -> None:
    """Fails when a low acceleration limit makes the reference overshoot its target, or never arrive."""
    chosen, shaper = settings_of(max_acceleration_deg_per_s2=most_deg), bounded()
    path = []
    for _ in range(round(5.0 / dt)):
        shaper.step(np.array([1.0]), np.zeros(1), chosen, dt)
        path.append(shaper.r[0])
    assert max(path) < 1.005
    assert path[-1] == pytest.approx(1.0, abs=1e-3)


def test_a_joint_limit_as_target_is_reached_and_kept() -> None:
    """Fails when the bound of the limits keeps the reference from reaching them."""
    for target in (LOW, HIGH):
        shaper = bounded(0.5)
        for _ in range(600):
            shaper.step(target, np.zeros(1), settings_of(), DT_S)
        assert shaper.r[0] == pytest.approx(target[0], abs=1e-4)
        assert shaper.v[0] == pytest.approx(0.0, abs=1e-3)


def test_a_slow_sine_passes_without_any_limit_acting() -> None:
    """Fails when the limits delay a motion that keeps them."""
    shaper, free = bounded(), Shaper(1)
    for k in range(2000):
        t = k * DT_S
        target, speed = np.array([0.7 + 0.6 * math.sin(2.0 * t)]), np.array([1.2 * math.cos(2.0 * t)])
        for either in (shaper, free):
            either.step(target, speed, settings_of(), DT_S)
        assert shaper.r[0] == free.r[0]
    assert abs(shaper.r[0] - target[0]) < 0.03


@pytest.mark.parametrize("dt", [0.0, -1.0, -1e38, 5e-324, 1e-9, math.nan, math.inf, -math.inf])
def test_a_step_that_takes_no_time_changes_nothing(dt: float) -> None:
    """Fails when dt = 0, negative, tiny, NaN or infinite moves a reference or a torque."""
    shaper, torque = bounded(0.5), TorqueLimiter(np.array([0.1]))
    shaper.step(np.array([1.0]), np.zeros(1), settings_of(), DT_S)
    before = shaper.r[0], shaper.v[0]
    shaper.step(np.array([1.0]), np.zeros(1), settings_of(), dt)
    torque.step(np.array([0.6]), 3.0, dt, True)
    assert (shaper.r[0], shaper.v[0], shaper.a[0]) == (*before, 0.0)
    assert torque.now[0] == 0.1


def test_a_huge_step_is_one_of_bounded_length() -> None:
    """Fails when a huge dt moves a reference or a torque further than the largest step."""
    once, huge = bounded(0.5), bounded(0.5)
    for shaper, dt in ((once, C.max_dt), (huge, 1e38)):
        shaper.step(np.array([1.0]), np.zeros(1), settings_of(), dt)
    torque = TorqueLimiter(np.array([0.1]))
    torque.step(np.array([0.6]), 3.0, 1e38, True)
    assert once.r[0] == huge.r[0] > 0.5
    assert torque.now[0] == pytest.approx(0.1 + 3.0 * C.max_dt)


def test_latching_beyond_a_limit_holds_the_limit() -> None:
    """Fails when a pose beyond the joint's limits becomes the reference."""
    assert bounded(1.9).r[0] == HIGH[0] and bounded(-0.4).r[0] == LOW[0]


@pytest.mark.parametrize(("most_deg", "bandwidth"), [(15000.0, 12.0), (15000.0, 60.0), (1000.0, 12.0)])
def test_the_stopping_point_is_reached_without_turning_back(most_deg: float, bandwidth: float) -> None:
    """Fails when a stop in mid-motion makes a joint turn back, or runs on much further than it must."""
    chosen = settings_of(max_acceleration_deg_per_s2=most_deg, reference_bandwidth_rad_per_s=bandwidth)
    shaper = bounded()
    while shaper.r[0] < 0.6:
        shaper.step(HIGH, np.zeros(1), chosen, 0.001)
    at, speed, point = shaper.r[0], shaper.v[0], shaper.stopping_point(chosen)
    path = []
    for _ in range(3000):
        shaper.step(point, np.zeros(1), chosen, 0.001)
        path.append(shaper.r[0])
    assert np.diff(path).min() > -2e-5 * speed
    assert path[-1] == pytest.approx(point[0], abs=1e-3)
    shortest = 0.5 * speed**2 / math.radians(most_deg)
    assert path[-1] - at <= max(shortest, speed / bandwidth) * 1.01


def test_torque_rises_and_falls_at_the_rate_in_torque_mode_only() -> None:
    """Fails when a torque target jumps, or a lower torque limit in position mode is not obeyed at once."""
    torque = TorqueLimiter(np.array([0.2, 0.2]))
    torque.step(np.array([0.6, 0.0]), 3.0, 0.01, True)
    assert torque.now == pytest.approx([0.23, 0.17])
    torque.step(np.array([0.6, 0.0]), 3.0, 0.01, False)
    assert torque.now == pytest.approx([0.26, 0.0])
    torque.start(np.array([math.nan, 0.3]))
    assert torque.now.tolist() == [0.0, 0.3]


def test_a_small_torque_limit_slows_the_approach_and_not_the_retreat() -> None:
    """Fails when a joint flexes faster than its first impact allows, or when the bound slows an opening joint."""
    chosen = settings_of(contact_stiffness_nm_per_rad=25.0)
    fastest = approach_speed(np.array([1e-4]), np.array([0.02]), chosen)
    assert fastest[0] == pytest.approx(0.02 / math.sqrt(1e-4 * 25.0))
    shaper, speeds = bounded(), []
    for target in (1.2, 0.0):
        for _ in range(700):
            shaper.step(np.array([target]), np.array([9.0]) * (target > 1.0), chosen, DT_S, fastest)
            speeds.append(shaper.v[0])
    assert max(speeds) == pytest.approx(fastest[0]) and min(speeds) < -4.0 * fastest[0]
    free = settings_of(contact_stiffness_nm_per_rad=0.0)
    assert np.isinf(approach_speed(np.array([1e-4]), np.zeros(1), free)).all()
