"""Which frames are new: gaps, wraps, repeated and old frames, and restarts of the board."""

from __future__ import annotations

import numpy as np
import pytest

from hand_driver.frame_order import MAX_GAP, RESTART_S, Arrival, FrameOrder

PERIOD_S = 0.005
NEW = Arrival(fresh=True)
OLD = Arrival(fresh=False)
WRAP = 1 << 32


class Stream:
    """A board that starts at a sequence and a board time [s], seen by a host whose clock reads time_s."""

    def __init__(self, first: int = 0, start_s: float = 0.0) -> None:
        self.first, self.start_s = first, start_s

    def take(self, order: FrameOrder, number: int, time_s: float) -> Arrival:
        """Sample number `number` of this run, received at time_s [s]."""
        board_us = round((self.start_s + number * PERIOD_S) * 1e6)
        return order.take((self.first + number) % WRAP, board_us, round(time_s * 1e9))


def running(stream: Stream, frames: int) -> FrameOrder:
    """An order that has seen this many frames, one per period."""
    order = FrameOrder()
    for number in range(frames):
        assert stream.take(order, number, number * PERIOD_S).fresh
    return order


@pytest.mark.parametrize("first", [0, WRAP - 3, WRAP // 2 - 2])
def test_a_stream_is_new_frame_by_frame(first: int) -> None:
    """Fails when a wrap of the sequence counts as a loss, an old frame or a restart."""
    order = FrameOrder()
    stream = Stream(first)
    assert [stream.take(order, k, k * PERIOD_S) for k in range(10)] == [NEW] * 10


def test_missing_frames_are_counted() -> None:
    """Fails when a gap is off by one, or the largest gap counts as a restart."""
    stream, order = Stream(), FrameOrder()
    got = [stream.take(order, k, 0.1) for k in (5, 6, 8, 12, 12 + MAX_GAP)]
    assert [arrival.missing for arrival in got] == [0, 0, 1, 3, MAX_GAP - 1]
    assert all(arrival.fresh and not arrival.restarted for arrival in got)


def test_every_repeated_or_older_frame_is_dropped_and_costs_nothing() -> None:
    """Fails when a repeated frame is taken for new, in blocks or one by one, or the next new one is dropped with it."""
    seed = 8
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    stream, order = Stream(WRAP - 500), running(Stream(WRAP - 500), 1000)
    for number in range(1000, 2000):
        now_s = number * PERIOD_S
        for old in rng.integers(0, number, rng.integers(0, 30)):
            assert stream.take(order, int(old), now_s) == OLD
        block = int(rng.integers(0, number - 40))
        assert [stream.take(order, k, now_s) for k in range(block, block + 40)] == [OLD] * 40
        assert stream.take(order, number, now_s) == NEW
        assert stream.take(order, number, now_s) == OLD


@pytest.mark.parametrize("ran", [80, 300, 100_000])
def test_a_restart_is_recognised_by_frames_that_continue(ran: int) -> None:
    """Fails when a board that restarts is never heard again, is not counted, or is counted twice."""
    stream = Stream()
    order = FrameOrder()
    stream.take(order, 0, 0.0)
    stream.take(order, ran, ran * PERIOD_S)
    begun_s = ran * PERIOD_S + 0.3
    got = [stream.take(order, k, begun_s + k * PERIOD_S) for k in range(100)]
    restarts = [k for k, arrival in enumerate(got) if arrival.restarted]
    assert len(restarts) == 1
    assert restarts[0] * PERIOD_S == pytest.approx(RESTART_S, abs=2 * PERIOD_S)
    assert all(arrival == NEW for arrival in got[restarts[0] + 1 :])
    assert not any(arrival.fresh for arrival in got[: restarts[0]])


def test_a_restart_is_recognised_although_every_frame_comes_twice() -> None:
    """Fails when repeated frames hide the restart of a board."""
    stream, order = Stream(), running(Stream(), 1000)
    got = [stream.take(order, k // 2, 5.5 + k * PERIOD_S / 2) for k in range(200)]
    assert sum(arrival.restarted for arrival in got) == 1
    assert got[-1] == OLD and got[-2] == NEW


def test_a_short_burst_of_old_frames_is_no_restart() -> None:
    """Fails when a link that repeats what it held during an interruption is taken for a restarted board."""
    stream, order = Stream(), running(Stream(), 1000)
    assert [stream.take(order, k, 5.2) for k in range(500, 900)] == [OLD] * 400
    assert stream.take(order, 1040, 5.2) == Arrival(fresh=True, missing=40)


def test_a_restart_with_any_first_sequence_and_time_is_recognised() -> None:
    """Fails when a board that begins anywhere after a restart is taken for the former run, or dropped for ever."""
    for first, start_s in ((5_000_000, 0.0), (123, 9e6), (WRAP - 7, 1.0)):
        order, stream = running(Stream(), 1000), Stream(first, start_s)
        got = [stream.take(order, k, 5.5 + k * PERIOD_S) for k in range(100)]
        assert sum(arrival.restarted for arrival in got) == 1, first


@pytest.mark.parametrize("outage_s", [0.5, 30.0, 3600.0])
def test_after_an_outage_the_same_run_continues(outage_s: float) -> None:
    """Fails when a board that kept running behind a lost link counts as restarted, with a clock that is 1 % off."""
    order = running(Stream(), 1000)
    order.reconnected()
    number = 1000 + round(outage_s / PERIOD_S)
    for share in (0.99, 1.0, 1.01):
        arrival = order.take(number, round((5.0 + outage_s * share) * 1e6), round((4.995 + outage_s) * 1e9))
        assert arrival.fresh and not arrival.restarted
        order = running(Stream(), 1000)
        order.reconnected()


def test_a_restart_during_a_long_outage_is_recognised_although_the_numbers_rise() -> None:
    """Fails when the board's counters have passed their former values during the outage and hide its restart."""
    order, stream = running(Stream(), 400), Stream()
    order.reconnected()
    got = [stream.take(order, k, 62.0 + (k - 12_000) * PERIOD_S) for k in range(10_000, 10_100)]
    assert not got[0].fresh
    assert sum(arrival.restarted for arrival in got) == 1


def test_frames_that_waited_in_a_buffer_are_no_restart() -> None:
    """Fails when a board or a host that stood still, and then hands over what has waited, counts as restarted."""
    stream, order = Stream(), running(Stream(), 1000)
    got = [stream.take(order, k, 10.0 + (k - 1000) * 0.001) for k in range(1000, 2200)]
    assert got == [NEW] * 1200
