"""The heartbeat option: off, alive, late, never."""

from __future__ import annotations

from hand_ros.heartbeat import Heartbeat

MS = 1_000_000


def test_without_a_timeout_none_is_needed() -> None:
    """Fails when the option is on by default."""
    assert Heartbeat(0.0).missing(10**18) == ""


def test_it_is_missing_before_the_first_and_after_the_timeout() -> None:
    """Fails when a hand is driven before the first heartbeat, or longer than the time-out after the last one."""
    heartbeat = Heartbeat(0.5)
    line = "no heartbeat for 0.5 s: check the node that publishes heartbeat"
    assert heartbeat.missing(0) == line
    heartbeat.beat(1000 * MS)
    assert heartbeat.missing(1500 * MS) == ""
    assert heartbeat.missing(1501 * MS) == line
    heartbeat.beat(1502 * MS)
    assert heartbeat.missing(1502 * MS) == ""
