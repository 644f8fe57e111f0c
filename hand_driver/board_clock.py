"""The board's clock mapped to the host's: the lower envelope of their difference, drift included.

A frame is received after it was acquired, with a varying delay; the smallest differences (received - board) belong to
the frames with the smallest delay. The smallest difference of each half second is one point; the mapping is the edge of
the lower convex hull of the recent points that spans their middle. Its slope is the error of the board's rate.
`WallClock` adds the difference between the host's monotonic clock and its time of day.

No stamp ever goes back, and none lags unnoticed: `rate_error` and `lag_s` measure what the mapping cannot follow.
"""

from __future__ import annotations

from collections import deque

BLOCK_US = 500_000
"""Board time over which the smallest difference is taken."""
FIRST_BLOCK_US = 100_000
"""The same for the first FIRST_BLOCKS blocks, so that a wrong rate is followed from the start."""
FIRST_BLOCKS = 5
BLOCKS = 16
"""Number of blocks kept: 8 s, over which the drift of a crystal is constant."""
MAX_DRIFT = 0.05
"""Largest relative error of the rate that is followed. Beyond it, a stamp is the time of receipt."""
MEASURED_BLOCKS = 8
"""Number of blocks after which the rate counts as measured."""
RESET_NS = 1_000_000_000
"""A larger change of the difference is a restart of the board."""


class BoardClock:
    """Maps board time to the host's monotonic clock; one object per connection."""

    def __init__(self) -> None:
        """Begin with no frame."""
        self._blocks: deque[tuple[int, int]] = deque(maxlen=BLOCKS)
        self._last_ns = 0
        self.lag_s = 0.0
        """Smallest delay [s] from stamp to receipt within the last block."""
        self._restart(0, 0)

    def _restart(self, board_us: int, offset_ns: int) -> None:
        self._blocks.clear()
        self._closed = 0
        self._block_end_us = board_us + FIRST_BLOCK_US
        self._lowest = (board_us, offset_ns)
        self._anchor = (board_us, offset_ns)
        self._drift = 0.0
        self._last_us = -1
        self._least_lag_ns = RESET_NS

    @property
    def rate_error(self) -> float | None:
        """Relative error of the board's rate [-], positive where its clock is fast; None before it is measured."""
        return 1.0 / (1.0 + self._drift) - 1.0 if self._closed >= MEASURED_BLOCKS else None

    def map(self, board_time_us: int, received_ns: int) -> int:
        """Host time [ns] of acquisition of a frame received at received_ns [ns].

        It rises from frame to frame, also over a restart of the board. It is never later than received_ns, except by
        1 ns per frame where several frames arrive together.
        """
        offset_ns = received_ns - board_time_us * 1000
        if (
            self._last_us < 0
            or board_time_us <= self._last_us
            or abs(offset_ns - self._offset(board_time_us)) > RESET_NS
        ):
            self._restart(board_time_us, offset_ns)
        elif offset_ns < self._lowest[1]:
            self._lowest = (board_time_us, offset_ns)
        if board_time_us >= self._block_end_us:
            self._fit(board_time_us)
        predicted = self._offset(board_time_us)
        if offset_ns < predicted:  # faster than every frame before: it moves the line
            self._anchor = (board_time_us, offset_ns)
            predicted = offset_ns
        stamp_ns = min(board_time_us * 1000 + predicted, received_ns)
        if abs(self._drift) > MAX_DRIFT:
            stamp_ns = received_ns
        self._least_lag_ns = min(self._least_lag_ns, received_ns - stamp_ns)
        self._last_us, self._last_ns = board_time_us, max(stamp_ns, self._last_ns + 1)
        return self._last_ns

    def _offset(self, board_time_us: int) -> int:
        anchor_us, anchor_ns = self._anchor
        return anchor_ns + round((board_time_us - anchor_us) * 1000 * self._drift)

    def _fit(self, board_time_us: int) -> None:
        """Close a block: the slope from the oldest lowest point under which no younger one falls."""
        self._blocks.append(self._lowest)
        self._closed += 1
        self.lag_s, self._least_lag_ns = self._least_lag_ns * 1e-9, RESET_NS
        self._block_end_us = board_time_us + (FIRST_BLOCK_US if self._closed < FIRST_BLOCKS else BLOCK_US)
        self._lowest = (board_time_us, 1 << 62)
        if len(self._blocks) < 2:
            return
        self._anchor, self._drift = _lower_edge(list(self._blocks))


def _lower_edge(points: list[tuple[int, int]]) -> tuple[tuple[int, int], float]:
    """Edge of the lower convex hull of (us, ns) points that spans their middle: its start and its slope."""
    hull: list[tuple[int, int]] = []
    for point in points:
        while len(hull) > 1 and _slope(hull[-2], hull[-1]) >= _slope(hull[-1], point):
            hull.pop()
        hull.append(point)
    middle = (points[0][0] + points[-1][0]) / 2
    start = max(i for i in range(len(hull) - 1) if hull[i][0] <= middle)
    return hull[start], _slope(hull[start], hull[start + 1]) * 1e-3


def _slope(a: tuple[int, int], b: tuple[int, int]) -> float:
    return (b[1] - a[1]) / max(b[0] - a[0], 1)


SLEW = 0.1
"""Share of the elapsed time by which stamps may be slowed while a small step back of the time of day is followed."""
SET_BACK_NS = 100_000_000
"""A larger step back is not followed: the stamps continue on the former time until the driver is started again."""
PATIENCE_NS = 200_000_000
"""A step back must last for so long: the two clocks are read one after the other, and a pause may lie between."""


class WallClock:
    """Maps the host's monotonic clock to its time of day so that stamps never go back."""

    def __init__(self) -> None:
        """Begin with the first reading."""
        self._offset_ns: int | None = None
        self._last_ns = 0
        self._behind_since_ns: int | None = None
        self.set_back_s = 0.0
        """How far [s] the time of day was set back and is not followed; 0 where it is."""

    def offset_ns(self, wall_ns: int, monotonic_ns: int) -> int:
        """What to add to monotonic times [ns], from a reading of both clocks. A step forward is followed at once."""
        measured = wall_ns - monotonic_ns
        offset = measured if self._offset_ns is None else self._offset_ns
        elapsed_ns, self._last_ns = max(monotonic_ns - self._last_ns, 0), monotonic_ns
        behind_ns = offset - measured
        self.set_back_s = 0.0
        if behind_ns <= 0:
            offset, self._behind_since_ns = measured, None
        elif self._behind_since_ns is None:
            self._behind_since_ns = monotonic_ns
        elif monotonic_ns - self._behind_since_ns > PATIENCE_NS:
            if behind_ns > SET_BACK_NS:
                self.set_back_s = behind_ns * 1e-9
            else:
                offset -= min(behind_ns, int(SLEW * elapsed_ns))
        self._offset_ns = offset
        return offset
