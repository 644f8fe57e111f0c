"""The rate of a counter, and its silence, at times that the test chooses."""

from __future__ import annotations

from hand_ros.rate_meter import SILENT_S, RateMeter


def test_the_rate_is_that_of_the_last_window() -> None:
    """Fails when a rate is stated before a window has ended, or is the mean since the start."""
    meter = RateMeter()
    assert [meter.update(20 * tick, 0.1 * tick) for tick in range(10)] == [None] * 10
    assert round(meter.update(200, 1.01) or 0.0) == 198
    assert round(meter.update(300, 2.02) or 0.0) == 99
    assert meter.update(0, 2.1) is None  # the counter began again
    assert meter.update(None, 2.2) is None


def test_silence_begins_with_the_last_count() -> None:
    """Fails when a node that counts nothing is called silent, or one that waits is not."""
    meter = RateMeter()
    meter.update(None, 0.0)
    assert not meter.silent(100.0)
    meter.update(0, 100.0)
    assert not meter.silent(100.0 + 0.9 * SILENT_S)
    assert meter.silent(100.0 + SILENT_S)
    meter.update(1, 110.0)
    assert not meter.silent(110.1)
