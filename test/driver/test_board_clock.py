"""The board clock against boards that drift, links that stall, and boards that restart."""

from __future__ import annotations

import numpy as np
import pytest

from hand_driver.board_clock import BoardClock, WallClock
from hand_driver.board_health import clock_health
from hand_messages.health import Level

MINIMUM_S = 0.2e-3


def stamps_ms(drift: float, seed: int, frames: int = 6000, rate_hz: float = 200.0) -> np.ndarray:
    """Errors [ms] of the stamps against the true times plus the shortest latency."""
    rng = np.random.default_rng(seed)
    clock = BoardClock()
    errors, last = [], 0
    for k in range(frames):
        true_s = 5.0 + k / rate_hz
        latency_s = MINIMUM_S + rng.exponential(0.5e-3) + (20e-3 if rng.random() < 0.01 else 0.0)
        received_ns = round((true_s + latency_s) * 1e9)
        stamp_ns = clock.map(round((k / rate_hz) * (1.0 + drift) * 1e6) + 77, received_ns)
        assert last < stamp_ns <= received_ns
        last = stamp_ns
        errors.append((stamp_ns * 1e-9 - true_s - MINIMUM_S) * 1e3)
    return np.array(errors)


@pytest.mark.parametrize("drift", [-5e-4, -2e-4, 0.0, 2e-4, 5e-4])
def test_stamps_follow_a_drifting_board_through_stalls(drift: float) -> None:
    """Fails when drift or jitter of the link gets into the stamps by more than half a millisecond after 2 s."""
    for seed in range(5):
        print(f"seed {seed}")
        assert np.abs(stamps_ms(drift, seed)[400:]).max() < 0.5


def test_a_board_that_restarts_is_followed_at_once() -> None:
    """Fails when a restart leaves stamps in the past."""
    clock = BoardClock()
    for k in range(1000):
        clock.map(10_000_000 + k * 5000, 10**9 + k * 5_000_000)
    now_ns = 10**9 + 1000 * 5_000_000
    assert clock.map(5000, now_ns) == now_ns
    assert clock.map(10_000, now_ns + 5_000_000) == now_ns + 5_000_000


def test_frames_that_arrive_together_get_stamps_of_their_own() -> None:
    """Fails when frames read at once, by a clock that knows nothing yet or after a restart, share one stamp."""
    clock = BoardClock()
    stamps = [clock.map(board_us, 10**9) for board_us in (5_000, 10_000, 15_000, 70, 5_070)]
    assert (np.diff(stamps) > 0).all()
    assert stamps[-1] - 10**9 < 5


@pytest.mark.parametrize("error", [-0.01, -0.003, 0.003, 0.01, 0.04])
def test_a_board_whose_clock_is_off_is_followed_and_measured(error: float) -> None:
    """Fails when a wrong rate lets the stamps lag or run ahead, is not measured, or is measured wrongly."""
    for seed in range(3):
        print(f"seed {seed}")
        errors_ms = np.abs(stamps_ms(error, seed))
        assert errors_ms[:400].max() < 2.0 + 100.0 * abs(error) + 25.0 * (errors_ms[:400] > 15.0).any()
        assert errors_ms[400:].max() < 1.0
        clock = BoardClock()
        rng = np.random.default_rng(seed)
        for k in range(1000):
            received_ns = round((5.0 + k / 200.0 + rng.exponential(0.5e-3)) * 1e9)
            clock.map(round(k / 200.0 * (1.0 + error) * 1e6), received_ns)
        assert clock.rate_error == pytest.approx(error, abs=2e-4)
        assert clock.lag_s < 1e-3
        said = clock_health(clock.rate_error, clock.lag_s, 0.0)
        assert said.level == Level.WARN
        assert ("fast" if error > 0.0 else "slow") in said.message
        assert f"{100.0 * abs(error):.1f}" in said.message


def test_a_good_clock_is_not_accused() -> None:
    """Fails when a crystal within its tolerance, or the jitter of a link, is named as a fault."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        clock = BoardClock()
        for k in range(4000):
            late_s = rng.exponential(0.5e-3) + (0.08 if rng.random() < 0.002 else 0.0)
            clock.map(round(k * 5000 * 1.0001), round((5.0 + k / 200.0 + late_s) * 1e9))
            assert clock_health(clock.rate_error, clock.lag_s, 0.0).level == Level.OK, (seed, k)


def test_a_rate_that_cannot_be_followed_is_stamped_by_receipt() -> None:
    """Fails when a board whose clock is 10 % slow gives stamps that are ever older than the frames."""
    clock = BoardClock()
    for k in range(2000):
        received_ns = round((5.0 + k / 200.0) * 1e9)
        stamp_ns = clock.map(round(k * 5000 * 0.9), received_ns)
        if k > 100:
            assert received_ns - stamp_ns < 5e6
    assert clock.rate_error == pytest.approx(-0.1, abs=2e-3)


def test_a_clock_that_steps_is_named() -> None:
    """Fails when stamps that lag by 60 ms pass unnoticed."""
    clock = BoardClock()
    for k in range(1000):
        clock.map(k * 5000, 10**9 + k * 5_000_000)
    levels = []
    for k in range(1000, 1400):
        clock.map(k * 5000 - 4_000 * min(k - 1000, 15), 10**9 + k * 5_000_000)
        levels.append(clock_health(clock.rate_error, clock.lag_s, 0.0).level)
    assert levels.index(Level.WARN) <= 250
    assert "57 ms after" in clock_health(None, 0.057, 0.0).message


def test_the_time_of_day_may_step_and_stamps_never_go_back() -> None:
    """Fails when a step of the host's clock, small or large, lets a stamp go back, or a large one is not named."""
    wall = WallClock()
    steps_ns = {200: 5_000_000_000, 600: -50_000_000, 1200: -3_600_000_000_000}
    set_ns, stamps, behind = 0, [], []
    for k in range(1600):
        set_ns += steps_ns.get(k, 0)
        now_ns = 10**12 + k * 5_000_000
        stamps.append(now_ns + wall.offset_ns(now_ns + 7 * 10**17 + set_ns, now_ns))
        behind.append(stamps[-1] - (now_ns + 7 * 10**17 + set_ns))
    assert (np.diff(stamps) > 0).all()
    assert behind[199] == behind[500] == 0  # a step forward is followed at once
    assert behind[900] == 0  # a small step back within a second
    assert min(behind) >= 0
    assert wall.set_back_s == pytest.approx(3600.0)
    assert clock_health(None, 0.0, wall.set_back_s).level == Level.ERROR


def test_a_pause_between_the_two_readings_moves_no_stamp() -> None:
    """Fails when a process that is delayed between reading the two clocks slows its stamps."""
    wall = WallClock()
    for k in range(1000):
        pause_ns = 3_000_000 if k % 7 == 3 else 0
        assert wall.offset_ns(10**18 + k * 5_000_000, k * 5_000_000 + pause_ns) == 10**18
