"""The age of the measurements: when pressure is refused, and when the hand is vented."""

from __future__ import annotations

import pytest

from hand_driver.silence import Silence

MS = 1_000_000


def test_pressure_is_refused_before_the_first_measurement_and_after_the_last() -> None:
    """Fails when pressure passes where nothing is measured, or is refused at an age that is allowed."""
    silence = Silence(200.0)
    assert "nothing has been measured yet" in silence.objection(0)
    silence.measured(0)
    assert silence.objection(100 * MS) == ""
    assert "no measurement for 0.1 s" in silence.objection(100 * MS + 1)
    silence.measured(500 * MS)
    assert silence.objection(600 * MS) == ""


def test_a_driven_hand_is_vented_where_the_silence_is_confirmed() -> None:
    """Fails when a hand is driven on without measurements, or a process that stood still latches."""
    silence = Silence(200.0)
    silence.measured(0)
    assert silence.fault(True, 100 * MS) == ""
    assert silence.fault(True, 110 * MS) == ""
    assert silence.fault(True, 149 * MS) == ""
    assert "no measurement for 0.1 s" in silence.fault(True, 150 * MS)
    silence.measured(160 * MS)
    assert silence.fault(True, 160 * MS) == ""
    assert silence.fault(True, 900 * MS) == ""  # it stood still: what has arrived meanwhile is read next
    silence.measured(901 * MS)
    assert silence.fault(True, 920 * MS) == ""
    assert silence.fault(True, 1_010 * MS) == ""


def test_a_vented_hand_may_be_silent() -> None:
    """Fails when a hand without pressure latches, or the time before it is driven counts."""
    silence = Silence(200.0)
    silence.measured(0)
    assert not any(silence.fault(False, now * MS) for now in range(0, 2000, 20))
    assert silence.fault(True, 2000 * MS) == ""


@pytest.mark.parametrize(("rate_hz", "longest_ms"), [(1000.0, 100), (20.0, 150), (2.0, 1500)])
def test_rare_frames_are_no_silence(rate_hz: float, longest_ms: int) -> None:
    """Fails when a slow board, or a simulation in slow motion, counts as silent between its frames."""
    silence = Silence(rate_hz)
    silence.measured(0)
    assert silence.objection(longest_ms * MS) == ""
    assert silence.objection(longest_ms * MS + 1) != ""
