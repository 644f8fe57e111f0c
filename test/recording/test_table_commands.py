"""Set-points of a table: in force when they were sent, and known where a row is missing, or left out."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hand_model.arrays import Array, Flags
from hand_recording.sample_clock import steady_times
from hand_recording.settings import READING
from hand_recording.table_commands import TableCommands, set_points_between

RATE_HZ, COUNT, TAU_S = 80.0, 2400, 0.05
SCATTER_S = 1.5e-3


def steps(rng: np.random.Generator) -> Array:
    """Set-points (COUNT,) [Pa] that step every 20 rows."""
    return np.repeat(rng.uniform(0.0, 4e5, COUNT // 20), 20)


def pressure_at(at_s: Array, sent_s: Array, sent_pa: Array) -> Array:
    """Pressure (n,) [Pa] of a valve with one time constant, at rising times, after set-points sent at rising times."""
    fine_s = np.arange(0.0, at_s[-1] + 1e-4, 1e-4)
    u = sent_pa[np.maximum(np.searchsorted(sent_s, fine_s, side="right") - 1, 0)]
    p, decay = np.zeros(len(fine_s)), math.exp(-1e-4 / TAU_S)
    for k in range(1, len(fine_s)):
        p[k] = u[k - 1] + (p[k - 1] - u[k - 1]) * decay
    return np.interp(at_s, fine_s, p)


def read(time_s: Array, sent_pa: Array, pressure_pa: Array) -> tuple[Array, int, Flags, Array]:
    """What is made of a table of one joint, and the grid; the readings alone say that their stamps are right."""
    smooth = np.sin(2.0 * np.pi * time_s)[:, None]
    clock = steady_times(time_s, time_s[0] + np.arange(COUNT) / RATE_HZ, smooth)
    found = set_points_between(clock, sent_pa[:, None], pressure_pa[:, None])
    return found.between_pa, found.parts, found.unknown, clock.grid_s


@pytest.mark.parametrize("steady", [True, False])
def test_the_pressures_say_when_set_points_were_sent(steady: bool) -> None:
    """Fails when set-points of a steady clock are put at the uneven stamps of their rows, or the others are not."""
    print("seed 91")
    rng = np.random.default_rng(91)
    ticks = np.arange(COUNT) / RATE_HZ
    stamps = ticks + np.append(0.0, np.clip(SCATTER_S * rng.standard_normal(COUNT - 1), -4e-3, 4e-3))
    sent_s, sent = ticks if steady else stamps, steps(rng)
    pressure = pressure_at(stamps, sent_s, sent) + 100.0 * rng.standard_normal(COUNT)
    between, parts, unknown, grid = read(stamps, sent, pressure)
    assert not unknown.any()
    if steady:
        np.testing.assert_array_equal(between[:-1, 0], np.repeat(sent[:-1], parts))
        return
    for row in (np.flatnonzero(np.diff(sent)) + 1).tolist():
        first = parts * (row - 3)
        ahead = between[first : first + 6 * parts, 0] - sent[row]
        before_s = float(ahead.sum() / (sent[row - 1] - sent[row])) / (parts * RATE_HZ)
        assert grid[row - 3] + before_s == pytest.approx(stamps[row], abs=1e-5)


def test_a_step_that_was_lost_is_left_out_and_a_slope_is_bridged() -> None:
    """Fails when a set-point is held over a missing row although it moves, or a step at an unknown time is believed."""
    print("seed 92")
    rng = np.random.default_rng(92)
    ticks = np.arange(COUNT) / RATE_HZ
    slope, sent = 1e5 + 2e4 * np.sin(ticks), steps(rng)
    kept = np.ones(COUNT, dtype=bool)
    kept[[410, 500, 505]] = False  # within a step, and at one
    for values, lost in ((slope, []), (sent, [500])):
        pressure = pressure_at(ticks, ticks, values) + 100.0 * rng.standard_normal(COUNT)
        between, parts, unknown, grid = read(ticks[kept], values[kept], pressure[kept])
        assert len(grid) == COUNT
        if not lost:
            np.testing.assert_allclose(between[::parts, 0], values, atol=50.0)
        expected = np.zeros(COUNT, dtype=bool)
        for tick in lost:
            expected[tick : tick + 25] = True  # from the row itself to 0.3 s after the row behind it
        np.testing.assert_array_equal(np.delete(unknown[:, 0], 525), np.delete(expected, 525))  # that is 0.3 s


def test_a_set_point_that_is_written_when_it_changes_holds() -> None:
    """Fails when an empty cell loses the set-point before it, or becomes a line to the next one."""
    ticks, sent = np.arange(COUNT) / RATE_HZ, np.full(COUNT, np.nan)
    sent[::400] = 1e5 * np.arange(6)
    between, parts, unknown, _ = read(ticks, sent, np.full(COUNT, 1e5))
    np.testing.assert_array_equal(between[::parts, 0], np.repeat(1e5 * np.arange(6), 400))
    assert not unknown.any()


def slow_table(sent: Array, every: int, rng: np.random.Generator) -> TableCommands:
    """What is made of every n-th row of a table of one joint."""
    ticks = np.arange(COUNT) / RATE_HZ
    pressure = pressure_at(ticks, ticks, sent) + 200.0 * rng.standard_normal(COUNT)
    rows = ticks[::every]
    clock = steady_times(rows, rows, np.sin(2.0 * np.pi * rows)[:, None])
    return set_points_between(clock, sent[::every, None], pressure[::every, None])


@pytest.mark.parametrize("every", [1, 2, 3])
def test_steps_of_a_table_may_have_come_since_the_row_before(every: int) -> None:
    """Fails when a step is taken to come at its row without asking the pressures, or another sample is called loose."""
    print("seed 93")
    rng = np.random.default_rng(93)
    sent = np.roll(np.repeat(rng.uniform(0.0, 4e5, COUNT // 40), 40), 7)
    found = slow_table(sent, every, rng)
    assert not found.refused.any() and not found.unknown.any() and found.parts > 1
    np.testing.assert_array_equal(found.loose[:, 0], np.abs(np.diff(sent[::every])) > READING.lost_step_pa)


def test_a_table_with_a_step_at_every_other_row_is_refused() -> None:
    """Fails when hardly a reading is left that does not place a step, and the joint is diagnosed."""
    print("seed 95")
    rng = np.random.default_rng(95)
    found = slow_table(np.roll(np.repeat(rng.uniform(0.0, 4e5, COUNT // 6), 6), 1), 3, rng)
    assert found.refused.tolist() == [True]
    assert not found.loose.any()
    assert not found.unknown.any(), "a joint that is refused has its readings; no frame is missing"


def test_smooth_set_points_between_the_rows_of_a_slow_table_are_bridged() -> None:
    """Fails when smooth set-points of a fast board are held from row to row, a half of a period late."""
    print("seed 94")
    rng = np.random.default_rng(94)
    ticks = np.arange(COUNT) / RATE_HZ
    frequencies_hz = np.array([[0.3, 0.7, 1.1, 1.6, 2.1, 2.6]]).T
    waves = np.sin(2.0 * np.pi * frequencies_hz * ticks + rng.uniform(0.0, 6.0, frequencies_hz.shape))
    sent = 2e5 + 3e4 * waves.sum(axis=0)
    pressure = pressure_at(ticks, ticks, sent) + 200.0 * rng.standard_normal(COUNT)
    rows = ticks[::3]
    found = set_points_between(steady_times(rows, rows, np.sin(rows)[:, None]), sent[::3, None], pressure[::3, None])
    assert not found.refused.any() and not found.unknown.any()
    fine = np.interp(np.linspace(rows[0], rows[-1], len(found.between_pa)), ticks, sent)
    assert len(fine) > 10 * len(rows)
    assert np.abs(found.between_pa[:, 0] - fine).max() < 5e3
