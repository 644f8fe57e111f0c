"""The lines that the recorder logs."""

from __future__ import annotations

from hand_recording.record_options import RecordSummary, TopicSummary
from hand_recording.recorder_health import RecorderHealth


def summary(duration_s: float, messages: int) -> RecordSummary:
    """A recording with messages of one topic."""
    topics = (TopicSummary("/hand/adc", "hand_msgs/msg/AdcFrame", messages, 0, 0.0, 0),) if messages else ()
    return RecordSummary("run", duration_s, topics, {})


def test_a_recording_that_works_is_logged_once_with_its_rate() -> None:
    """Fails when the line is missing, repeated, or its rate counts the time before the first message."""
    health = RecorderHealth(("/hand",))
    logged = [health.healthy(summary(0.5 * k, 100 * max(k - 6, 0))) for k in range(20)]  # from 3.5 s on, 200 a second
    lines = [line for line in logged if line]
    assert lines == ["healthy: recorder of 1 topics runs in /hand at 200 messages/s, into run"]
    assert logged.index(lines[0]) == 9
    assert not any(health.silent(summary(0.5 * k, 100 * max(k - 6, 0))) for k in range(20))


def test_a_recording_without_messages_is_reported_once() -> None:
    """Fails when nothing is logged, or a line is logged at once or again and again."""
    health = RecorderHealth(("/left_hand", "/right_hand"))
    logged = [health.silent(summary(0.5 * k, 0)) for k in range(40)]
    expected = "not healthy: recorder in /left_hand, /right_hand receives no messages, for run"
    assert [line for line in logged if line] == [expected] and logged[10] == expected
    assert not any(health.healthy(summary(0.5 * k, 0)) for k in range(40))
