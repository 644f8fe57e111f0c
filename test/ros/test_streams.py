"""Messages of two publishers of one topic are distinguished by their numbers."""

from __future__ import annotations

import random

import pytest

from hand_ros.streams import MOST_HZ, SHOWN_S, SILENCE_S, SLACK, Stream

MS = 1_000_000


def followed(count: int = 100, period_ns: int = 5 * MS) -> tuple[Stream, int]:
    stream = Stream()
    for number in range(1, count + 1):
        assert stream.take(number, number * period_ns)
    return stream, count * period_ns


def test_one_publisher_is_followed_whatever_is_lost() -> None:
    """Fails when lost messages, queues or pauses of the only publisher make it look like two."""
    seed = 4711
    print("seed", seed)
    rng = random.Random(seed)
    stream, number, now_ns, sent_ns = Stream(), 0, 0, 0
    for _ in range(20_000):
        pause_ns = rng.choice((1, 1, 1, 5, 60, 90, 300)) * MS
        sent_ns += pause_ns
        number += max(1, pause_ns // MS)  # 1 kHz, of which only the last one arrives
        now_ns = max(now_ns, sent_ns + rng.randrange(2 * MS))
        assert stream.take(number, now_ns)
        assert not stream.disturbed(now_ns)


@pytest.mark.parametrize("number", [1, 2, 50, 100, 101 + SLACK + round(MOST_HZ * 0.005) + 1, 10**9])
def test_the_first_message_of_another_publisher_is_refused(number: int) -> None:
    """Fails when a number that the followed publisher cannot have reached passes, or is not remembered."""
    stream, now_ns = followed()
    assert not stream.take(number, now_ns + 5 * MS)
    assert stream.disturbed(now_ns + 5 * MS)
    assert stream.take(101, now_ns + 5 * MS)
    assert not stream.disturbed(now_ns + 5 * MS + round(SHOWN_S * 1e9) + 1)


@pytest.mark.parametrize("stall_ms", [25, 90, 300])
def test_what_has_waited_while_a_node_stood_still_is_of_one_publisher(stall_ms: int) -> None:
    """Fails when a node that stood still takes its queue for a second publisher, or believes every number for long."""
    stream, now_ns = followed()
    last = 101 + round(MOST_HZ * stall_ms * 1e-3)  # of a publisher at the fastest rate
    now_ns += stall_ms * MS
    for number, later_ns in ((101, 0), (102, 0), (last, 1000)):
        assert stream.take(number, now_ns + later_ns), number
    assert not stream.disturbed(now_ns + MS)
    for after_ms in range(5, 61, 5):
        assert stream.take(last + after_ms // 5, now_ns + after_ms * MS)
    assert not stream.take(last + 13 + SLACK + round(MOST_HZ * 0.005) + 1, now_ns + 65 * MS)


def test_two_publishers_cannot_both_be_followed() -> None:
    """Fails when a second one, whose numbers happen to continue those of the first, stays unnoticed."""
    stream, now_ns = followed()
    assert stream.take(105, now_ns + 2 * MS)
    assert not stream.take(101, now_ns + 5 * MS)
    assert stream.disturbed(now_ns + 5 * MS)


def test_after_silence_a_new_publisher_is_followed() -> None:
    """Fails when a commander that was restarted is refused for ever."""
    stream, now_ns = followed()
    later_ns = now_ns + round(SILENCE_S * 1e9) + MS
    assert stream.take(1, later_ns)
    assert stream.take(2, later_ns + MS)


def test_without_numbers_everything_is_taken() -> None:
    """Fails when a middleware that gives no numbers stops the hand."""
    stream = Stream()
    assert all(stream.take(None, now_ns) for now_ns in range(5))
    assert not stream.disturbed(5)
