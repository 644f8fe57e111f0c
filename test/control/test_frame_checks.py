"""Checks of every frame: plausibility, pressures that follow the valve, tolerances; declared numbers written out."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_control.declared import Settings
from hand_control.frame_checks import (
    _HIGHER,
    _LOWER,
    FINE,
    FOLLOWING,
    JUMPED,
    NOT_FINITE,
    OVER_PRESSURE,
    STEPPED,
    STUCK_HIGH,
    STUCK_LOW,
    PressureWatch,
    implausible,
)
from hand_control.tolerance_watch import ToleranceWatch
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


def towards(begin: float, end: float) -> list[float]:
    """Readings [Pa] from begin to end in steps that a valve may make."""
    return [float(p) for p in np.linspace(begin, end, 2 + int(abs(end - begin) / 5e3))[:-1]]


def first(verdicts: list[int]) -> tuple[int, int]:
    """Number of frames until the first verdict that is not FOLLOWING, and that verdict; (0, FOLLOWING) for none."""
    return next(((k + 1, v) for k, v in enumerate(verdicts) if v != FOLLOWING), (0, FOLLOWING))


def test_over_pressure_trips_after_50_ms_above_110_percent() -> None:
    """Fails when the limit, its margin of 10 % or the time of 50 ms changes."""
    rise = towards(LIMIT_PA, 1.1 * LIMIT_PA)
    assert first(watched(LIMIT_PA, rise + [1.101 * LIMIT_PA] * 40)) == (len(rise) + 11, OVER_PRESSURE)
    assert first(watched(LIMIT_PA, rise + [1.099 * LIMIT_PA] * 40)) == (0, FOLLOWING)
    interrupted = ([1.101 * LIMIT_PA] * 9 + [1.099 * LIMIT_PA]) * 2
    assert first(watched(LIMIT_PA, rise + interrupted)) == (0, FOLLOWING)


@pytest.mark.parametrize("expected", [0.0, 1e5, 4e5])
def test_a_valve_follows_within_20_kpa_and_10_percent(expected: float) -> None:
    """Fails when the band of 20 kPa plus 10 % of the expected pressure, or the time of 0.5 s, changes."""
    band = 2e4 + 0.1 * expected
    way = towards(expected, expected + band)
    count, found = first(watched(expected, way + [expected + band + 0.5] * 130))
    assert found == STUCK_HIGH and count == pytest.approx(len(way) + 101, abs=1)
    assert first(watched(expected, way + [expected + band - 0.5] * 130)) == (0, FOLLOWING)
    interrupted = ([expected + 1.01 * band] * 95 + [expected + 0.99 * band]) * 2
    assert first(watched(expected, way + interrupted)) == (0, FOLLOWING)


@pytest.mark.parametrize("expected", [1e5, 4e5])
def test_a_pressure_below_its_usual_difference_is_too_low_after_100_ms(expected: float) -> None:
    """Fails when the band of 8 kPa plus 10 % below the usual difference, or the time of 0.1 s, changes."""
    band = 8e3 + 0.1 * expected
    way = towards(expected, expected - band)
    count, found = first(watched(expected, way + [expected - band - 2e3] * 130))
    assert found == STUCK_LOW and count == pytest.approx(len(way) + 21, abs=1)
    assert first(watched(expected, way + [expected - band + 5e2] * 130)) == (0, FOLLOWING)


@pytest.mark.parametrize("usual", [-1.5e4, 1.5e4])
def test_a_usual_difference_widens_no_band(usual: float) -> None:
    """Fails when a sensor that has always read too low or too high is allowed a larger error than another."""
    way = towards(2e5, 2e5 + usual) + [2e5 + usual] * 2000
    count, found = first(watched(2e5, way + towards(2e5 + usual, 1.59e5) + [1.59e5] * 40))
    assert found == STUCK_LOW and count > len(way)


@pytest.mark.parametrize("expected", [0.0, 2e4])
def test_a_pressure_that_arrives_late_is_not_too_low(expected: float) -> None:
    """Fails when a pressure that follows is too low for ever, because it was above the expectation for some seconds."""
    late = towards(expected, expected + 1.9e4) + [expected + 1.9e4] * 1000
    way = late + towards(expected + 1.9e4, expected) + [expected] * 400
    assert first(watched(expected, way)) == (0, FOLLOWING)
    fallen = towards(expected, expected - 1.2e4) + [expected - 1.2e4] * 40
    count, found = first(watched(expected, way + fallen))
    assert found == STUCK_LOW and count > len(way)


@pytest.mark.parametrize("speed", [-5.0, 5.0])
@pytest.mark.parametrize("off", [-4e4, 4e4])
def test_motion_explains_a_pressure_only_in_its_own_direction(speed: float, off: float) -> None:
    """Fails when a joint that extends excuses a pressure that is too low, or one that flexes one that is too high."""
    watch = PressureWatch(HAND)
    angle, verdicts = full(0.5 if speed > 0.0 else 1.0), []
    watch.start(full(2e5), angle)
    for number in range(30):
        angle = angle + speed * DT_S
        pressure = full(2e5)
        pressure[2] += off * min(number / 8, 1.0)
        verdicts.append(watch.check(full(2e5), pressure, DT_S, angle)[0])
    explained = speed * off < 0.0
    assert (STUCK_LOW in verdicts) == (off < 0.0 and not explained)
    band = 2e4 + 0.1 * 2e5
    assert (watch._state[_HIGHER, 2] > band) == (speed < 0.0)
    assert (watch._state[_LOWER, 2] > band) == (speed > 0.0)


def test_far_off_counts_sooner() -> None:
    """Fails when a pressure far above what the valve gives is tolerated for as long as one slightly above."""
    far = 2e5 + 2e4 + 2e4 + 5e4
    way = towards(2e5, far)
    count, found = first(watched(2e5, way + [far] * 100))
    excess = sum(max(p - 2.4e5, 0.0) for p in way) * DT_S
    assert found == STUCK_HIGH and count == pytest.approx(len(way) + (5e3 - excess) / 5e4 / DT_S, abs=2)


@pytest.mark.parametrize(("reading", "dt_frames"), [(1e5, 1), (0.0, 1), (2.5e5, 1)])
def test_a_pressure_that_steps_and_stays_is_found_in_two_frames(reading: float, dt_frames: int) -> None:
    """Fails when a sensor at another scale, off, or exchanged with another is followed, or a spike trips."""
    assert first(watched(2e5, [2e5] * 50 + [reading] * 10)) == (50 + 1 + 2 * dt_frames, STEPPED)
    assert first(watched(2e5, [2e5] * 50 + [reading] + [2e5] * 10)) == (0, FOLLOWING)


def test_a_small_step_counts_where_it_is_a_share_of_the_pressure_above_the_noise() -> None:
    """Fails when half or more of a low pressure is believed, or when noise, a spike or a pinched tube trips."""
    print("seed 8")
    for noise_pa, found in ((150.0, STEPPED), (3e3, FOLLOWING)):  # the threshold rises with the noise
        calm = (3e4 + np.random.default_rng(8).normal(0.0, noise_pa, 1600)).tolist()
        assert first(watched(3e4, calm))[1] == FOLLOWING
        assert first(watched(3e4, [*calm, *[1.5e4] * 6]))[1] == found
    calm = (3e4 + np.random.default_rng(8).normal(0.0, 150.0, 1600)).tolist()
    assert first(watched(3e4, [*calm, *[4.8e4] * 6])) == (1603, STEPPED)
    assert first(watched(3e4, [*calm, 1.5e4, *[3e4] * 20]))[1] == FOLLOWING
    assert first(watched(3e4, [*calm, *[2.4e4] * 20]))[1] == FOLLOWING


def test_a_valve_four_times_as_fast_makes_no_step() -> None:
    """Fails when a valve that is faster than described is taken for a sensor that steps."""
    pressure, readings = 0.0, []
    for _ in range(60):
        pressure += (1.0 - math.exp(-4.0 * DT_S / LAG_S)) * (5e5 - pressure)
        readings.append(pressure)
    assert STEPPED not in watched(5e5, readings, start=0.0)
    low = [3e4 + 150.0 * math.sin(0.7 * n) for n in range(1600)]
    for asked in (6e4, 0.0):  # a small step of the set-point, when the noise is known
        watch, pressure, found = PressureWatch(HAND), 3e4, []
        watch.start(full(3e4))
        for n in range(1660):
            pressure += (1.0 - math.exp(-4.0 * DT_S / LAG_S)) * (asked - pressure) if n >= 1600 else 0.0
            reading = low[n] if n < 1600 else pressure
            found.append(watch.check(full(3e4 if n < 1600 else asked), full(reading), DT_S)[0])
        assert STEPPED not in found


def test_no_set_point_rises_while_a_pressure_is_too_low_and_it_returns_along_a_ramp() -> None:
    """Fails when a set-point rises on without its pressure, or returns at once when the pressure does."""
    watch = PressureWatch(HAND)
    watch.start(full(2e5))
    fall, sent, limited = towards(2e5, 1.6e5), [], []
    pressures = [*fall, *fall[::-1], *[2e5] * 10]
    for frame in range(90):
        asked = full(2e5 if frame < 8 else 3e5)
        watch.hold(asked, DT_S)
        limited.append(bool(watch.short[2]))
        sent.append(asked[2])
        watch.check(asked, full(pressures[frame] if frame < len(pressures) else asked[2]), DT_S)
    assert limited[8] and max(sent[: len(fall)]) == 2e5
    assert np.diff(sent).max() == pytest.approx(1.0e6 * DT_S)
    assert sent[-1] == 3e5 and not limited[-1]


def test_a_board_that_vents_is_expected_without_pressure_although_a_set_point_was_reduced() -> None:
    """Fails when what `hold` took off a set-point is expected on while the board lets all pressure out."""
    watch = PressureWatch(HAND)
    watch.start(full(0.0))
    for _ in range(60):  # no pressure comes: after 0.1 s the set-points are reduced
        asked = full(3e5)
        watch.hold(asked, DT_S)
        watch.check(asked, full(0.0), DT_S)
    assert asked[2] < 1e5 and watch.expected[2] > 2e5
    for _ in range(round(8.0 * LAG_S / DT_S)):
        watch.hold(full(3e5), DT_S)
        watch.check(full(0.0), full(0.0), DT_S)
    assert watch.expected == pytest.approx(full(0.0), abs=1e3)


def test_the_expectation_is_the_set_point_through_the_lag_of_the_valve() -> None:
    """Fails when a pressure that follows a step as the valve does is called stuck, or a dead valve is not noticed."""
    command, pressure, readings = 3e5, 0.0, []
    for _ in range(200):
        pressure += DT_S / (DT_S + LAG_S) * (command - pressure)
        readings.append(pressure)
    assert first(watched(command, readings, start=0.0)) == (0, FOLLOWING)
    count, verdict = first(watched(command, [0.0] * 200, start=0.0))
    expected = slow = outside = excess = 0.0  # of a valve as described and of one twice as slow
    while outside <= 0.1 and excess <= 0.1 * 2e4:
        expected += (1.0 - math.exp(-DT_S / LAG_S)) * (command - expected)
        slow += (1.0 - math.exp(-DT_S / (2.0 * LAG_S))) * (command - slow)
        above = slow - 0.1 * expected - 8e3
        outside, excess = (outside + DT_S, excess + above * DT_S) if above > 0.0 else (0.0, 0.0)
        predicted = outside
    assert verdict == STUCK_LOW
    assert count * DT_S == pytest.approx(predicted, abs=4 * DT_S)


def test_the_lag_of_the_expectation_is_time_constant_plus_dead_time() -> None:
    """Fails when the expectation is not that of a valve up to twice as slow as described: 0.2 s and 0.1 s here."""
    parameters = HAND.parameters.copy()
    parameters[ROW["valve.time_constant_s"]], parameters[ROW["valve.dead_time_s"]] = 0.2, 0.1
    watch, command = PressureWatch(replace(HAND, parameters=parameters)), full(2.5e4)
    watch.start(full(0.0))
    verdicts = [watch.check(command, full(0.0), DT_S)[0] for _ in range(400)]
    expected, slow, outside = 0.0, 0.0, 0
    while slow <= 1.5e4:  # the dead valve is within the band of the expectation
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
    for share in np.linspace(0.0, 1.0, 40):
        pressure[[1, 4]] = 2e5 - share * 2e5
        pressure[3] = 2e5 + share * 1.5e5
        watch.check(full(2e5), pressure, DT_S)
    for _ in range(120):
        verdict = watch.check(full(2e5), pressure, DT_S)
    assert verdict == (STUCK_HIGH, 3)
    for share in np.linspace(0.0, 1.0, 60):
        pressure[6] = 2e5 + share * (1.2 * LIMIT_PA - 2e5)
        watch.check(full(2e5), pressure, DT_S)
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
