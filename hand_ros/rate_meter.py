"""The rate of a counter over the last full window. Pure: times are arguments."""

from __future__ import annotations

WINDOW_S = 1.0
SILENT_S = 5.0
"""A node that starts first waits about this long for the others."""


class RateMeter:
    """Cycles per second over windows of WINDOW_S; unknown before the first of them ends."""

    def __init__(self) -> None:
        """Begin without a window."""
        self._begun: tuple[float, int] | None = None
        self._rate_hz: float | None = None
        self._counted = (0.0, -1)

    def update(self, count: int | None, now_s: float) -> float | None:
        """The rate [1/s] of the counter at now_s [s]; None where it is unknown, or count is None.

        A counter that falls, as at a restart of what it counts, begins a new measurement.
        """
        if count != self._counted[1]:
            self._counted = (now_s, -1 if count is None else count)
        if count is None:
            self._begun = self._rate_hz = None
        elif self._begun is None or count < self._begun[1]:
            self._begun, self._rate_hz = (now_s, count), None
        elif now_s - self._begun[0] >= WINDOW_S:
            self._rate_hz = (count - self._begun[1]) / (now_s - self._begun[0])
            self._begun = (now_s, count)
        return self._rate_hz

    def silent(self, now_s: float) -> bool:
        """Whether the counter has stood still for SILENT_S at now_s [s] of the same clock."""
        return self._begun is not None and now_s - self._counted[0] >= SILENT_S
