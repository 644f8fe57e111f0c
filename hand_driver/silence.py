"""Whether the driver measures the hand that it drives: the age of the last frame in which anything was measured.

    age of the last such frame                               reaction
    none yet                                                 set-points above 0 Pa are refused
    > SILENCE_S, and PERIODS of the frames                   set-points above 0 Pa are refused
    the same for CONFIRMED_S while the hand is driven        vent, latched

A process that stood still finds an old frame first, although newer ones wait to be read; CONFIRMED_S is the time to
read them. The controller vents within this time, too, so that one reset is enough where it drives. Times are
nanoseconds of one monotonic clock and are arguments.
"""

from __future__ import annotations

from hand_driver.driver_health import SILENCE_S

PERIODS = 3.0
"""So many periods without a frame are allowed where frames are rare."""
CONFIRMED_S = 0.04
"""Two periods of the driver's watch."""


class Silence:
    """The age of the measurements. Another thread may report frames."""

    def __init__(self, rate_hz: float) -> None:
        """Begin without a measurement; rate_hz: of the frames, in the time of the host [1/s]."""
        self._longest_s = max(SILENCE_S, PERIODS / rate_hz)
        self._measured_ns: int | None = None
        self._found_ns: int | None = None

    def measured(self, now_ns: int) -> None:
        """A frame arrived in which an angle or a pressure was measured."""
        self._measured_ns = now_ns

    def objection(self, now_ns: int) -> str:
        """Why no pressure may be written, one line; empty where the hand is measured."""
        if self._measured_ns is None:
            return "nothing has been measured yet; check power, sensor supply and wiring of the board"
        if now_ns - self._measured_ns <= self._longest_s * 1e9:
            return ""
        return f"no measurement for {self._longest_s:g} s; check power, sensor supply and wiring of the board"

    def fault(self, driving: bool, now_ns: int) -> str:
        """Why the hand must be vented, one line, or empty. driving: whether pressure is in force. Call it often."""
        line = self.objection(now_ns) if driving else ""
        if not line:
            self._found_ns = None
        elif self._found_ns is None:
            self._found_ns = now_ns
        elif now_ns - self._found_ns >= CONFIRMED_S * 1e9:
            return line
        return ""
