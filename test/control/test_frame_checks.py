"""Checks of every frame: plausibility, pressures that follow the valve, tolerances; declared numbers written out."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_control.declared import Settings
from hand_control.frame_checks import (
    FINE,
    FOLLOWING,
    JUMPED,
    NOT_FINITE,
    OVER_PRESSURE,
    STUCK_HIGH,
    STUCK_LOW,
    PressureWatch,
    ToleranceWatch,
    implausible,
)
from hand_model.arrays import Array, Flags
from hand_model.description import load_hand
from hand_model.kernel.rows import ROW

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
COUNT = len(HAND.joints)
LAG_S = (HAND.row("valve.time_constant_s") + HAND.row("valve.dead_time_s"))[0]
LIMIT_PA = float(HAND.limits.max_pressure_pa[0])
DT_S = 0.005


def full(value: float) -> Array:
    return np.full(COUNT, value)


@pytest.mark.parametrize("which", range(3))
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_the_first_value_that_is_not_finite_is_named(which: int, bad: float) -> None:
    """Fails when a NaN or infinite measurement passes, or another joint is named."""
    measured = [full(0.3), full(0.1), full(1e5)]
    measured[which][[4, 7]] = bad
    measured[0][2] = 3.0  # a jump does not come first
    assert implausible(*measured, full(0.3), 0.5) == (NOT_FINITE, 4)


def test_the_largest_jump_is_named() -> None:
    """Fails when a jump beyond the limit passes, in either direction, or the wrong joint is named."""
    position = full(0.3)
    assert implausible(position, full(0.0), full(0.0), full(0.3), 0.5) == (FINE, 0)
    position[3], position[5] = 0.9, -0.4
    assert implausible(position, full(0.0), full(0.0), full(0.3), 0.5) == (JUMPED, 5)
    position[5] = 0.3
    assert implausible(position, full(0.0), full(0.0), full(0.3), 0.5) == (JUMPED, 3)
    assert implausible(position, full(0.0), full(0.0), full(0.3), 0.61) == (FINE, 0)
    exact = full(0.0)
    exact[1] = 0.5
    assert implausible(exact, full(0.0), full(0.0), full(0.0), 0.5)[0] == FINE


def test_opposite_values_do_not_hide_one_another() -> None:
    """Fails when large finite values of opposite sign are taken for a value that is not finite."""
    assert implausible(full(1.0), full(-1.0), full(-1e5), full(1.0), 0.5) == (FINE, 0)


def watched(command: float, pressures: list[float], joint: int = 2, start: float | None = None) -> list[int]:
    """Verdicts under a constant command while one joint reads these pressures; the others follow exactly."""
    watch, expected = PressureWatch(HAND), full(command if start is None else start)
    watch.start(expected)
    verdicts = []
    for reading in pressures:
        expected = expected + DT_S / (DT_S + LAG_S) * (command - expected)
        pressure = expected.copy()
        pressure[joint] = reading
        verdict, worst = watch.check(full(command), pressure, DT_S)
        assert worst == (joint if verdict != FOLLOWING else 0)
        verdicts.append(verdict)
    return verdicts


def first(verdicts: list[int]) -> tuple[int, int]:
    """Number of frames until the first verdict that is not FOLLOWING, and that verdict; (0, FOLLOWING) for none."""
    return next(((k + 1, v) for k, v in enumerate(verdicts) if v != FOLLOWING), (0, FOLLOWING))


def test_over_pressure_trips_after_50_ms_above_110_percent() -> None:
    """Fails when the limit, its margin of 10 % or the time of 50 ms changes."""
    assert first(watched(LIMIT_PA, [1.101 * LIMIT_PA] * 40)) == (11, OVER_PRESSURE)
    assert first(watched(LIMIT_PA, [1.099 * LIMIT_PA] * 40)) == (0, FOLLOWING)
    interrupted = [1.2 * LIMIT_PA] * 9 + [LIMIT_PA] + [1.2 * LIMIT_PA] * 9 + [LIMIT_PA]
    assert first(watched(LIMIT_PA, interrupted)) == (0, FOLLOWING)


@pytest.mark.parametrize("expected", [0.0, 1e5, 4e5])
def test_a_valve_follows_within_20_kpa_and_10_percent(expected: float) -> None:
    """Fails when the band of 20 kPa plus 10 % of the expected pressure, or the times of 0.5 and 0.1 s, change."""
    band = 2e4 + 0.1 * expected
    frames = 130
    for sign, verdict, patience in ((1.0, STUCK_HIGH, 100), (-1.0, STUCK_LOW, 20)):
        count, found = first(watched(expected, [expected] * 5 + [expected + sign * (band + 0.5)] * frames))
        assert found == verdict and count == pytest.approx(patience + 6, abs=1)
        assert first(watched(expected, [expected + sign * (band - 0.5)] * frames)) == (0, FOLLOWING)
        interrupted = ([expected + sign * 1.01 * band] * (patience - 5) + [expected]) * 2
        assert first(watched(expected, interrupted)) == (0, FOLLOWING)


def test_the_expectation_is_the_set_point_through_the_lag_of_the_valve() -> None:
    """Fails when a pressure that follows a step as the valve does is called stuck, or a dead valve is not noticed."""
    command, pressure, readings = 3e5, 0.0, []
    for _ in range(200):
        pressure += DT_S / (DT_S + LAG_S) * (command - pressure)
        readings.append(pressure)
    assert first(watched(command, readings, start=0.0)) == (0, FOLLOWING)
    count, verdict = first(watched(command, [0.0] * 200, start=0.0))
    until_outside = -2.0 * LAG_S * math.log(1.0 - 2e4 / (0.9 * command))  # of a valve twice as slow as described
    assert verdict == STUCK_LOW
    assert count * DT_S == pytest.approx(0.1 + until_outside, abs=3 * DT_S)


def test_the_lag_of_the_expectation_is_time_constant_plus_dead_time() -> None:
    """Fails when the expectation is not that of a valve up to twice as slow as described: 0.2 s and 0.1 s here."""
    parameters = HAND.parameters.copy()
    parameters[ROW["valve.time_constant_s"]], parameters[ROW["valve.dead_time_s"]] = 0.2, 0.1
    watch, command = PressureWatch(replace(HAND, parameters=parameters)), full(2.5e4)
    watch.start(full(0.0))
    verdicts = [watch.check(command, full(0.0), DT_S)[0] for _ in range(400)]
    expected, slow, outside = 0.0, 0.0, 0
    while slow <= 2e4 + 0.1 * expected:  # the dead valve is within the band of the expectation
        expected += (1.0 - math.exp(-DT_S / 0.3)) * (2.5e4 - expected)
        slow += (1.0 - math.exp(-DT_S / 0.6)) * (2.5e4 - slow)
        outside += 1
    assert outside > 100
    assert verdicts.index(STUCK_LOW) + 1 == pytest.approx(outside + 20, abs=1)


def test_the_start_forgets_earlier_deviations() -> None:
    """Fails when an earlier deviation counts after a new start, or the start does not set the expectation."""
    watch = PressureWatch(HAND)
    watch.start(full(0.0))
    for _ in range(95):
        watch.check(full(0.0), full(1e5), DT_S)
    watch.start(full(1e5))
    for _ in range(95):
        assert watch.check(full(1e5), full(1e5), DT_S)[0] == FOLLOWING


def test_the_most_urgent_verdict_is_reported_with_its_joint() -> None:
    """Fails when a starved joint hides over-pressure, or the first of two joints with one verdict is not named."""
    watch = PressureWatch(HAND)
    watch.start(full(2e5))
    pressure = full(2e5)
    pressure[[1, 4]] = 0.0
    pressure[3] = 3.5e5
    for _ in range(120):
        verdict = watch.check(full(2e5), pressure, DT_S)
    assert verdict == (STUCK_HIGH, 3)
    pressure[6] = 1.2 * LIMIT_PA
    for _ in range(15):
        verdict = watch.check(full(2e5), pressure, DT_S)
    assert verdict == (OVER_PRESSURE, 6)
    pressure[[3, 6]] = 2e5
    assert watch.check(full(2e5), pressure, DT_S) == (STUCK_LOW, 1)


NONE, ALL = np.zeros(COUNT, dtype=np.bool_), np.ones(COUNT, dtype=np.bool_)
TOLERANT = Settings.of(HAND, {"path_tolerance_deg": 5.0, "goal_tolerance_deg": 2.0, "goal_time_s": 0.3})


def off(joint: int, degrees: float) -> Array:
    error = full(0.0)
    error[joint] = math.radians(degrees)
    return error


@pytest.mark.parametrize(
    ("degrees", "on_path", "at_goal", "frames", "line"),
    [
        (5.1, ALL, NONE, 21, "index_proximal is off the path by 5.1 degrees, 5.0 are allowed"),
        (-5.1, ALL, NONE, 21, "index_proximal is off the path by 5.1 degrees, 5.0 are allowed"),
        (4.9, ALL, NONE, 0, ""),
        (2.1, NONE, ALL, 61, "index_proximal is not at the goal by 2.1 degrees, 2.0 are allowed"),
        (1.9, NONE, ALL, 0, ""),
        (50.0, NONE, NONE, 0, ""),
    ],
)
def test_trajectories_abort_outside_their_tolerance(
    degrees: float, on_path: Flags, at_goal: Flags, frames: int, line: str
) -> None:
    """Fails when the tolerance, the 100 ms on the path or the time at the goal changes, or the wrong joint is named."""
    watch, joint = ToleranceWatch(HAND), HAND.joints.index("index_proximal")
    reasons = [watch.check(off(joint, degrees), on_path, at_goal, TOLERANT, DT_S) for _ in range(100)]
    count = next((k + 1 for k, reason in enumerate(reasons) if reason), 0)
    assert count == pytest.approx(frames, abs=1)
    if line:
        assert reasons[count - 1] == f"joint_trajectory aborted: {line}; its joints hold their measured angle"


def test_a_short_deviation_aborts_nothing() -> None:
    """Fails when the times of separate deviations add up, or continue after the end of the trajectory."""
    watch = ToleranceWatch(HAND)
    for _ in range(5):
        for _ in range(18):
            assert not watch.check(off(0, 20.0), ALL, NONE, TOLERANT, DT_S)
        assert not watch.check(off(0, 1.0), ALL, NONE, TOLERANT, DT_S)
    for _ in range(5):
        for _ in range(18):
            assert not watch.check(off(0, 20.0), ALL, NONE, TOLERANT, DT_S)
        assert not watch.check(off(0, 20.0), NONE, NONE, TOLERANT, DT_S)
    for _ in range(5):
        for _ in range(55):
            assert not watch.check(off(0, 20.0), NONE, ALL, TOLERANT, DT_S)
        assert not watch.check(off(0, 20.0), NONE, NONE, TOLERANT, DT_S)


def test_only_joints_of_the_trajectory_count() -> None:
    """Fails when a joint outside the trajectory aborts it."""
    watch, mine = ToleranceWatch(HAND), np.arange(COUNT) == 1
    for _ in range(100):
        assert not watch.check(off(0, 20.0), mine, NONE, TOLERANT, DT_S)
        assert not watch.check(off(0, 20.0), NONE, mine, TOLERANT, DT_S)


def test_a_tolerance_below_one_degree_aborts() -> None:
    """Fails when a small tolerance counts as none."""
    small = Settings.of(HAND, {"path_tolerance_deg": 0.5, "goal_tolerance_deg": 0.5, "goal_time_s": 0.3})
    for on_path, at_goal in ((ALL, NONE), (NONE, ALL)):
        watch = ToleranceWatch(HAND)
        assert not watch.check(off(0, 0.4), on_path, at_goal, small, DT_S)
        assert any(watch.check(off(0, 0.6), on_path, at_goal, small, DT_S) for _ in range(100))


def test_a_tolerance_of_zero_never_aborts() -> None:
    """Fails when the default settings abort a trajectory."""
    watch = ToleranceWatch(HAND)
    for _ in range(300):
        assert not watch.check(off(0, 90.0), ALL, ALL, Settings.of(HAND, {}), DT_S)
