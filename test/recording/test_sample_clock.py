"""The sample clock: frames are numbered although stamps scatter, and the readings decide whose times are right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_recording.sample_clock import has_reading, stamp_scatter_s, steadier, steady_times
from hand_recording.signal_files import uniform_clock
from hand_sim.sample_ticks import rebuild_ticks, usual_period

RATE_HZ, COUNT = 100.0, 3000
PERIOD_NS = round(1e9 / RATE_HZ)


def motion(time_s: np.ndarray) -> np.ndarray:
    """Angles (N, 1) [rad] of an ordinary motion."""
    return (0.6 * np.sin(2 * np.pi * 0.7 * time_s) + 0.2 * np.sin(2 * np.pi * 2.3 * time_s))[:, None]


@pytest.mark.parametrize(("scatter_ms", "lost"), [(0.0, 0.3), (3.0, 0.05), (4.0, 0.05)])
@pytest.mark.parametrize("drift", [0.0, 0.01])
def test_frames_get_their_ticks_although_stamps_scatter(scatter_ms: float, lost: float, drift: float) -> None:
    """Fails when scattering stamps, lost frames or a drifting clock give a frame the tick of another one."""
    print("seed 80")
    rng = np.random.default_rng(80)
    tick = np.flatnonzero(rng.random(COUNT) >= lost)
    away = rng.uniform(-scatter_ms, scatter_ms, len(tick)) * 1e6
    stamps = np.rint(tick * PERIOD_NS * (1.0 + drift) + away).astype(np.int64)
    ticks = rebuild_ticks(stamps, RATE_HZ)
    np.testing.assert_array_equal(ticks.number, tick - tick[0])
    assert ticks.period_s == pytest.approx((1.0 + drift) / RATE_HZ, rel=1e-4)
    assert stamp_scatter_s(stamps, ticks) == pytest.approx(scatter_ms * 1e-3 / np.sqrt(3.0), rel=0.05, abs=1e-8)


@pytest.mark.parametrize(
    ("rate_hz", "scatter_ms", "lost"),
    [
        (100.0, 3.0, 0.03),
        (100.0, 3.0, 0.0),
        (200.0, 2.0, 0.0),
        (200.0, 2.0, 0.03),
        (200.0, 3.0, 0.03),
        (200.0, 3.0, 0.002),
    ],
)
def test_wide_scatter_loses_no_frame_and_invents_none(rate_hz: float, scatter_ms: float, lost: float) -> None:
    """Fails when normal scatter of up to 0.4 periods shifts frames by whole ticks, or gives a wrong rate."""
    print("seed 83")
    rng = np.random.default_rng(83)
    tick = np.flatnonzero(rng.random(COUNT) >= lost)
    away = np.clip(scatter_ms * 1e-3 * rng.standard_normal(len(tick)), -0.4 / rate_hz, 0.4 / rate_hz)
    stamps = np.unique(np.rint((tick / rate_hz + away) * 1e9).astype(np.int64))
    assert 1e9 / usual_period((stamps - stamps[0]).astype(float)) == pytest.approx(rate_hz, rel=0.02)
    ticks = rebuild_ticks(stamps, rate_hz)
    assert ticks.period_s == pytest.approx(1.0 / rate_hz, rel=1e-4)
    assert ticks.start_ns == pytest.approx(tick[0] / rate_hz * 1e9, abs=0.1e9 / rate_hz)
    # Between two frames that scatter, the place of a lost one is known to a few frames only.
    assert np.abs(ticks.number - (tick - tick[0])).max() <= 1
    assert np.mean(ticks.number != tick - tick[0]) < 0.02
    assert ticks.number[-1] == tick[-1] - tick[0]


@pytest.mark.parametrize("seed", [14, 16, 25])
def test_a_short_recording_with_a_wide_scatter_has_its_nominal_clock(seed: int) -> None:
    """Fails when 15 s, of which a wide search sees too little, get the median distance as their period."""
    rng = np.random.default_rng(seed)
    tick = np.flatnonzero(rng.random(1500) >= 0.04)
    away = np.clip(0.3 * rng.standard_normal(len(tick)), -0.4, 0.4)
    ticks = rebuild_ticks(np.unique(np.rint((tick + away) * 1e7).astype(np.int64)), 100.0)
    away_by = ticks.number - tick
    assert np.mean(away_by != np.median(away_by)) < 0.02


def test_a_stall_of_the_host_loses_no_frame() -> None:
    """Fails when frames that a busy host stamps late, one right after the other, count as later frames."""
    stamps = np.arange(COUNT) * PERIOD_NS
    stamps[1000:1008] = stamps[1008] - np.arange(8, 0, -1) * PERIOD_NS // 20
    np.testing.assert_array_equal(rebuild_ticks(stamps, RATE_HZ).number, np.arange(COUNT))


@pytest.mark.parametrize("period", [0.004, 0.01, 0.013])
def test_a_clock_whose_rate_changes_is_followed(period: float) -> None:
    """Fails when a rate that drifts by 1 % within the recording, with lost frames, loses or invents a tick."""
    print("seed 84")
    rng = np.random.default_rng(84)
    tick = np.flatnonzero(rng.random(COUNT) >= 0.02)
    at_s = period * (tick + 0.005 * tick**2 / COUNT)
    stamps = np.rint((at_s + 0.02 * period * rng.standard_normal(len(tick))) * 1e9).astype(np.int64)
    np.testing.assert_array_equal(rebuild_ticks(stamps, 1.0 / period).number, tick - tick[0])


@pytest.mark.parametrize(("true_at_ticks", "expected"), [(True, True), (False, False)])
def test_the_readings_say_whose_times_are_right(true_at_ticks: bool, expected: bool) -> None:
    """Fails when stamps that are wrong are kept, or stamps that are right are changed."""
    print("seed 81")
    rng = np.random.default_rng(81)
    at_ticks = np.arange(COUNT) / RATE_HZ
    stamped = at_ticks + rng.uniform(-3e-3, 3e-3, COUNT)
    noise = np.radians(0.03) * rng.standard_normal((COUNT, 1))
    values = motion(at_ticks if true_at_ticks else stamped) + noise
    stamps = np.rint((stamped - stamped[0]) * 1e9).astype(np.int64)
    ticks = rebuild_ticks(stamps, RATE_HZ)
    assert steadier(stamps, ticks, values) is expected
    resting = steadier(stamps, ticks, noise)
    assert resting is None, "a joint at rest cannot say whose times are right"
    grid = stamped[0] + np.arange(COUNT) / RATE_HZ
    clock = steady_times(stamped, grid, values)
    assert clock.jitter_s == 0.0
    assert "1.7 ms" in clock.notes[0]
    assert np.array_equal(clock.time_s, stamped) is not expected
    np.testing.assert_allclose(clock.tick_s - clock.tick_s[0], at_ticks, atol=2e-4)
    assert steady_times(stamped, grid, noise).jitter_s == pytest.approx(3e-3 / np.sqrt(3.0), rel=0.05)
    assert steady_times(at_ticks, at_ticks, values).notes == ()


@pytest.mark.parametrize(("rate_hz", "digits"), [(30.0, 6), (70.0, 9), (150.0, 4)])
def test_rounded_times_of_a_table_are_those_of_its_clock(rate_hz: float, digits: int) -> None:
    """Fails when times that are rounded to the digits of a file get a grid of another rate, or are not on it."""
    exact = np.arange(COUNT) / rate_hz
    rounded = exact.round(digits)
    _, grid = uniform_clock(Path("table.csv"), rounded)
    clock = steady_times(rounded, grid, motion(exact))
    assert len(clock.grid_s) == COUNT
    np.testing.assert_allclose(clock.grid_s, exact, atol=0.6 * 10.0**-digits)
    np.testing.assert_array_equal(clock.time_s, clock.grid_s)


@pytest.mark.parametrize("scatter", [0.36, 0.4])
def test_a_table_with_widely_scattered_times_keeps_its_clock(scatter: float) -> None:
    """Fails when rows of a clock without a lost tick get another rate, some of them count as lost, or noise decides
    whose times are right.
    """
    print("seed 85")
    rng = np.random.default_rng(85)
    at = np.sort(np.arange(COUNT) + scatter * rng.standard_normal(COUNT)) / RATE_HZ
    kept, grid = uniform_clock(Path("table.csv"), at)
    at = at[kept]
    noise = 0.02 * rng.standard_normal((len(at), 1))
    clock = steady_times(at, grid, motion(at) + noise)
    assert len(clock.grid_s) == pytest.approx(COUNT, abs=2)
    assert clock.grid_s[1] - clock.grid_s[0] == pytest.approx(1.0 / RATE_HZ, rel=1e-4)
    assert has_reading(clock.grid_s, clock.tick_s).mean() > 0.999
    np.testing.assert_array_equal(clock.time_s, at)  # readings belong to their stamps, or noise hides to what


def test_times_without_a_clock_get_none() -> None:
    """Fails when rows at random times are put on the ticks of a clock that nothing has."""
    print("seed 86")
    at = np.cumsum(np.random.default_rng(86).exponential(1.0 / RATE_HZ, COUNT))
    kept, grid = uniform_clock(Path("table.csv"), at)
    clock = steady_times(at[kept], grid, motion(at[kept]))
    np.testing.assert_array_equal(clock.tick_s, at[kept])


def test_lost_samples_have_no_reading() -> None:
    """Fails when a sample that was lost counts as a reading, or one that exists does not."""
    print("seed 82")
    grid = np.arange(200) / RATE_HZ
    kept = np.random.default_rng(82).random(200) > 0.2
    kept[[0, -1]] = True
    np.testing.assert_array_equal(has_reading(grid, grid[kept] + 1e-4), kept)
