"""References: who replaces whom, where a trajectory leads and how it gets there."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hand_control.command_check import CommandError, check_joint_command, check_trajectory
from hand_control.declared import Settings
from hand_control.references import References
from hand_control.shaping import Shaper
from hand_model.arrays import Array
from hand_model.description import load_hand

HAND = load_hand(Path(__file__).resolve().parents[2] / "config" / "hand.yaml")
COUNT = len(HAND.joints)
START = 7_000_000_000
A, B = "index_distal", "thumb_opposition"
IA, IB = HAND.joints.index(A), HAND.joints.index(B)
HERE = 0.2
angles = st.floats(float(HAND.limits.low_rad.max()), float(HAND.limits.high_rad.min()))
Point = tuple[float, list[float], list[float]]


def at(seconds: float) -> int:
    return START + round(seconds * 1e9)


def latched() -> References:
    references = References(HAND)
    references.latch(np.full(COUNT, HERE))
    return references


def command(references: References, names: list[str], position: list[float], effort: list[float] | None = None) -> None:
    references.command(check_joint_command(HAND, names, position, effort or [], 0, START))


def follow(references: References, names: list[str], points: list[Point], starts_s: float, now_s: float) -> None:
    references.trajectory(check_trajectory(HAND, names, points, at(starts_s), at(now_s)))


def sampled(references: References, seconds: Array, joint: int = IA) -> tuple[Array, Array]:
    """Target and speed of a joint at ascending times."""
    rows = [tuple(row[joint] for row in references.sample(at(s))[:2]) for s in seconds]
    target, speed = np.array(rows).T
    return target, speed


def test_begins_at_the_lower_limits() -> None:
    """Fails with a beginning that asks for pressure before anything is known."""
    target, speed, limit = References(HAND).sample(START)
    np.testing.assert_array_equal(target, HAND.limits.low_rad)
    np.testing.assert_array_equal(speed, 0.0)
    np.testing.assert_array_equal(limit, HAND.limits.max_torque_nm)


def test_latch_ends_everything() -> None:
    """Fails when a command, a trajectory or a torque limit remains after a latch."""
    references = latched()
    command(references, [B], [1.0], [0.1])
    follow(references, [A], [(1.0, [1.0], [])], 0.0, 0.0)
    references.sample(at(0.5))
    pose = np.linspace(0.1, 0.6, COUNT)
    references.latch(pose)
    for seconds in (0.6, 5.0):
        target, speed, limit = references.sample(at(seconds))
        np.testing.assert_array_equal(target, pose)
        np.testing.assert_array_equal(speed, 0.0)
        np.testing.assert_array_equal(limit, HAND.limits.max_torque_nm)


def test_latch_keeps_its_own_pose() -> None:
    """Fails with a latch that shares memory with the measurement."""
    references, pose = References(HAND), np.full(COUNT, 0.3)
    references.latch(pose)
    pose[:] = 1.0
    np.testing.assert_array_equal(references.sample(START)[0], 0.3)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_latch_of_what_is_not_finite(bad: float) -> None:
    """Broken by a NaN or infinite target: the joint keeps its target, first the lower limit."""
    pose = np.full(COUNT, 0.5)
    pose[IA] = bad
    fresh = References(HAND)
    fresh.latch(pose)
    assert fresh.sample(START)[0][IA] == HAND.limits.low_rad[IA]
    references = latched()
    references.latch(pose)
    target = references.sample(START)[0]
    assert target[IA] == HERE and target[IB] == 0.5


def test_command_rules_its_joints_only() -> None:
    """Fails with a partial command that moves or limits other joints."""
    references = latched()
    command(references, [B, A], [1.0, 0.7], [0.1, float("nan")])
    target, _, limit = references.sample(START)
    expected, limits = np.full(COUNT, HERE), HAND.limits.max_torque_nm.copy()
    expected[[IA, IB]], limits[IB] = (0.7, 1.0), 0.1
    np.testing.assert_array_equal(target, expected)
    np.testing.assert_array_equal(limit, limits)


def test_command_without_torque_returns_to_the_configured_limit() -> None:
    """Fails with a torque limit that outlives the command it came with."""
    references = latched()
    command(references, [A], [0.7], [0.1])
    assert references.sample(START)[2][IA] == 0.1
    command(references, [A], [0.7])
    assert references.sample(START)[2][IA] == HAND.limits.max_torque_nm[IA]


def test_hand_description_is_left_alone() -> None:
    """Fails with a torque limit or target written into the description's own arrays."""
    low, most = HAND.limits.low_rad.copy(), HAND.limits.max_torque_nm.copy()
    references = References(HAND)
    command(references, [A], [0.7], [0.1])
    references.sample(START)
    np.testing.assert_array_equal(HAND.limits.low_rad, low)
    np.testing.assert_array_equal(HAND.limits.max_torque_nm, most)


def test_command_ends_its_joints_trajectory_only() -> None:
    """Fails with a trajectory that pulls a commanded joint back, or that stops for the others."""
    references = latched()
    follow(references, [A, B], [(1.0, [1.0, 1.2], [])], 0.0, 0.0)
    references.sample(at(0.5))
    command(references, [A], [0.4])
    target, speed, _ = references.sample(at(0.6))
    assert target[IA] == 0.4 and speed[IA] == 0.0
    assert HERE < target[IB] < 1.2 and speed[IB] > 0.0
    target, speed, _ = references.sample(at(1.5))
    assert target[IA] == 0.4 and target[IB] == pytest.approx(1.2) and speed[IB] == 0.0


def test_later_trajectory_replaces_its_joints_only() -> None:
    """Fails with two trajectories that rule one joint, or a replacement that takes joints it does not name."""
    references = latched()
    follow(references, [A, B], [(1.0, [1.0, 1.2], [])], 0.0, 0.0)
    before = references.sample(at(0.5))[0][IA]
    follow(references, [A], [(1.0, [0.3], [])], 0.5, 0.5)
    after = references.sample(at(0.5))[0][IA]
    assert after == pytest.approx(before, abs=1e-12)
    references.sample(at(1.0))
    target, speed, _ = references.sample(at(3.0))
    assert target[IA] == pytest.approx(0.3) and target[IB] == pytest.approx(1.2)
    np.testing.assert_array_equal(speed, 0.0)


def test_replaced_trajectory_does_not_come_back() -> None:
    """Fails with an older, longer trajectory that continues after the newer, shorter one has ended."""
    references = latched()
    follow(references, [A], [(5.0, [1.5], [])], 0.0, 0.0)
    references.sample(at(0.5))
    follow(references, [A], [(0.5, [0.4], [])], 0.5, 0.5)
    target, _ = sampled(references, np.array([0.5, 1.0, 1.1, 3.0, 6.0]))
    np.testing.assert_allclose(target[1:], 0.4)


def test_trajectory_with_velocities_takes_over_in_motion() -> None:
    """Fails with a speed that drops to 0 where a stream of short trajectories replaces one by the next."""
    references = latched()
    follow(references, [A], [(0.0, [0.2], [0.5]), (1.0, [0.7], [0.5])], 0.0, 0.0)
    before = sampled(references, np.array([0.5]))
    follow(references, [A], [(1.0, [0.95], [0.5])], 0.5, 0.5)
    after = sampled(references, np.array([0.5, 1.0]))
    np.testing.assert_allclose(after[1], before[1][0])
    np.testing.assert_allclose(after[0], [before[0][0], 0.7])


def test_refused_message_changes_nothing() -> None:
    """Fails with a message that is taken in part before it is refused."""
    references = latched()
    follow(references, [B], [(1.0, [1.0], [])], 0.0, 0.0)
    before = [row.copy() for row in references.sample(at(0.4))]
    with pytest.raises(CommandError):
        command(references, [A, B], [0.5, float("nan")])
    with pytest.raises(CommandError):
        follow(references, [B, A], [(1.0, [0.5, 0.5], []), (2.0, [0.5, 9.0], [])], 0.0, 0.0)
    for now, then in zip(references.sample(at(0.4)), before, strict=True):
        np.testing.assert_array_equal(now, then)
    assert references.sample(at(1.0))[0][IB] == pytest.approx(1.0)


def test_trajectory_waits_for_its_start() -> None:
    """Fails with a trajectory that starts when it arrives although it is stamped ahead."""
    references = latched()
    follow(references, [A], [(1.0, [1.0], [])], 2.0, 0.0)
    target, speed = sampled(references, np.array([0.0, 1.0, 2.0]))
    np.testing.assert_allclose(target, HERE)
    np.testing.assert_allclose(speed, 0.0)
    target, _ = sampled(references, np.array([2.5, 3.0, 9.0]))
    np.testing.assert_allclose(target, [(HERE + 1.0) / 2.0, 1.0, 1.0])


def test_joint_command_ends_a_trajectory_that_waits() -> None:
    """Fails with a trajectory that comes to life after a newer command."""
    references = latched()
    follow(references, [A], [(1.0, [1.0], [])], 2.0, 0.0)
    command(references, [A], [0.6])
    target, _ = sampled(references, np.linspace(0.0, 4.0, 20))
    np.testing.assert_array_equal(target, 0.6)


def test_running_trajectory_goes_on_until_the_next_one_starts() -> None:
    """Fails with a later start that freezes the joint in mid-motion, or by speed left on a target that stands."""
    references = latched()
    follow(references, [A, B], [(1.0, [1.0, 1.0], [])], 0.0, 0.0)
    sampled(references, np.array([0.5]))
    follow(references, [A], [(1.0, [0.4], [])], 3.0, 0.5)
    target, speed = sampled(references, np.array([0.75, 1.0, 2.9]))
    assert HERE < target[0] < 1.0 and speed[0] > 0.0
    np.testing.assert_allclose(target[1:], 1.0)
    np.testing.assert_array_equal(speed[1:], 0.0)
    target, _ = sampled(references, np.array([3.0, 3.5, 4.0]))
    np.testing.assert_allclose(target, [1.0, 0.7, 0.4])


def test_newer_trajectory_takes_its_joint_from_one_that_waits() -> None:
    """Fails with an older trajectory that starts over a newer one, or that is lost for its other joints."""
    references = latched()
    follow(references, [A, B], [(1.0, [1.0, 1.2], [0.0, 0.0])], 2.0, 0.0)
    follow(references, [A], [(1.0, [0.6], [])], 0.0, 0.0)
    sampled(references, np.linspace(0.0, 4.0, 40))
    target = references.sample(at(5.0))[0]
    assert target[IA] == pytest.approx(0.6) and target[IB] == pytest.approx(1.2)


def test_latch_ends_a_trajectory_that_waits() -> None:
    """Fails when a trajectory from before a fault moves the hand after it is enabled again."""
    references = latched()
    follow(references, [A], [(1.0, [1.0], [])], 2.0, 0.0)
    references.latch(np.full(COUNT, 0.3))
    np.testing.assert_array_equal(sampled(references, np.linspace(0.0, 4.0, 20))[0], 0.3)


@pytest.mark.parametrize("starts_s", [0.0, 1.0])
def test_clock_that_begins_again_drops_trajectories(starts_s: float) -> None:
    """Fails with a trajectory that springs to life when the new clock reaches the old start."""
    references = latched()
    follow(references, [A], [(2.0, [1.5], [])], starts_s, 0.0)
    held = references.sample(at(0.5))[0][IA]
    target, speed = sampled(references, np.array([-5.0, -4.0, 0.0, 1.0, 2.0, 9.0]))
    np.testing.assert_array_equal(target, held)
    np.testing.assert_array_equal(speed, 0.0)


def test_slewed_clock_goes_on() -> None:
    """Fails with a trajectory that is dropped because the clock was put back a little."""
    references = latched()
    follow(references, [A], [(1.0, [1.0], [])], 0.0, 0.0)
    target, _ = sampled(references, np.array([0.5, 0.45, 1.0]))
    assert target[-1] == pytest.approx(1.0)


def test_velocities_of_the_message_are_those_of_the_path() -> None:
    """Fails with another interpolation than cubic Hermite: a cubic polynomial comes back exactly."""
    references = latched()
    times = np.array([0.0, 0.7, 1.6, 2.0])

    def cubic(t: Array) -> Array:
        return np.asarray(0.2 + 0.3 * t + 0.2 * t**2 - 0.1 * t**3)

    def slope(t: Array) -> Array:
        return np.asarray(0.3 + 0.4 * t - 0.3 * t**2)

    points = [(float(t), [float(cubic(t))], [float(slope(t))]) for t in times]
    follow(references, [A], points, 0.0, 0.0)
    seconds = np.linspace(0.0, 1.99, 50)
    target, speed = sampled(references, seconds)
    np.testing.assert_allclose(target, cubic(seconds), atol=1e-9)
    np.testing.assert_allclose(speed, slope(seconds), atol=1e-8)


def test_steep_velocities_stay_inside_the_limits() -> None:
    """Fails with a path that swings out of the joint's range between two points inside it."""
    references = latched()
    follow(references, [A], [(0.0, [1.6], [20.0]), (1.0, [1.6], [-20.0]), (2.0, [0.0], [20.0])], 0.0, 0.0)
    target, _ = sampled(references, np.linspace(0.0, 2.5, 200))
    assert target.max() == HAND.limits.high_rad[IA] and target.min() == HAND.limits.low_rad[IA]
    assert target[-1] == pytest.approx(0.0, abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(steps=st.lists(st.floats(0.05, 2.0), min_size=1, max_size=6), corners=st.lists(angles, min_size=6, max_size=6))
def test_path_without_velocities_never_overshoots(steps: list[float], corners: list[float]) -> None:
    """Fails with a path that leaves the range of two neighbouring points, misses one, or ends with speed."""
    references = latched()
    times = np.cumsum(steps)
    points: list[Point] = [(float(t), [corner], []) for t, corner in zip(times, corners, strict=False)]
    follow(references, [A], points, 0.0, 0.0)
    knots, begin = [HERE, *corners[: len(steps)]], 0.0
    for before, after, end in zip(knots[:-1], knots[1:], times, strict=True):
        target, _ = sampled(references, np.linspace(begin, float(end), 12))
        assert target.min() >= min(before, after) - 1e-7 and target.max() <= max(before, after) + 1e-7
        assert target[-1] == pytest.approx(after, abs=1e-6)
        begin = float(end)
    target, speed = sampled(references, np.array([begin + 0.001, begin + 100.0]))
    np.testing.assert_allclose(target, knots[-1], atol=1e-9)
    np.testing.assert_array_equal(speed, 0.0)


@settings(max_examples=30, deadline=None)
@given(corners=st.lists(angles, min_size=2, max_size=4), breaks=st.lists(st.floats(0.1, 0.9), min_size=1, max_size=3))
def test_path_is_continuous_through_replacements(corners: list[float], breaks: list[float]) -> None:
    """Fails with a jump of the path where a trajectory takes over from another in mid-motion."""
    references, now = latched(), 0.0
    for goal, part in zip(corners, breaks, strict=False):
        before = references.sample(at(now))[0][IA]
        follow(references, [A], [(1.0, [goal], [])], now, now)
        target, _ = sampled(references, now + np.linspace(0.0, part, 100))
        assert target[0] == pytest.approx(before, abs=1e-9)
        # At most 1.5 times the mean slope of a piece that begins and ends at rest.
        assert np.abs(np.diff(target)).max() <= 1.6 * abs(goal - before) * part / 99 + 1e-9
        now += part


@settings(max_examples=25, deadline=None)
@given(goals=st.lists(angles, min_size=1, max_size=4), max_speed=st.floats(0.5, 10.0))
def test_shaped_reference_keeps_its_speed_bound(goals: list[float], max_speed: float) -> None:
    """Fails with steps or a first point at time 0 that make the shaped reference jump, or never arrive."""
    references, shaper, dt = latched(), Shaper(COUNT), 0.005
    chosen = Settings.of(HAND, {"max_speed_deg_per_s": math.degrees(max_speed)})
    shaper.latch(np.full(COUNT, HERE))
    now = 0.0
    for number, goal in enumerate(goals):
        if number % 2:
            follow(references, [A], [(0.0, [goal], [])], now, now)
        else:
            command(references, [A], [goal])
        for _ in range(1000):
            before = shaper.r[IA]
            now += dt
            target, speed, _ = references.sample(at(now))
            shaper.step(target, speed, chosen, dt)
            assert abs(shaper.r[IA] - before) <= max_speed * dt * (1.0 + 1e-9)
            assert abs(shaper.v[IA]) <= max_speed * (1.0 + 1e-9)  # the parameter is in degrees
        assert shaper.r[IA] == pytest.approx(goal, abs=1e-3)
