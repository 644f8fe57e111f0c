"""The board's clock mapped to the host's: the lower envelope of their difference, drift included.

A frame is received after it was acquired, with a varying delay; the smallest differences (received - board) belong to
the frames with the smallest delay. The smallest difference of each half second is one point; the mapping is the edge of
the lower convex hull of the recent points that spans their middle.
"""

from __future__ import annotations

from collections import deque

BLOCK_US = 500_000
"""Board time over which the smallest difference is taken."""
BLOCKS = 16
"""Number of blocks kept: 8 s, over which the drift of a crystal is constant."""
MAX_DRIFT = 5e-4
"""Largest relative error of the rate of a board's crystal that is followed."""
RESET_NS = 1_000_000_000
"""A larger change of the difference is a restart of the board."""


class BoardClock:
    """Maps board time to the host's monotonic clock; one object per connection."""

    def __init__(self) -> None:
        """Begin with no frame."""
        self._blocks: deque[tuple[int, int]] = deque(maxlen=BLOCKS)
        self._last_ns = 0
        self._restart(0, 0)

    def _restart(self, board_us: int, offset_ns: int) -> None:
        self._blocks.clear()
        self._block_end_us = board_us + BLOCK_US
        self._lowest = (board_us, offset_ns)
        self._anchor = (board_us, offset_ns)
        self._drift = 0.0
        self._last_us = -1

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
        self._last_us, self._last_ns = board_time_us, max(stamp_ns, self._last_ns + 1)
        return self._last_ns

    def _offset(self, board_time_us: int) -> int:
        anchor_us, anchor_ns = self._anchor
        return anchor_ns + round((board_time_us - anchor_us) * 1000 * self._drift)

    def _fit(self, board_time_us: int) -> None:
        """Close a block: the slope from the oldest lowest point under which no younger one falls."""
        self._blocks.append(self._lowest)
        self._block_end_us = board_time_us + BLOCK_US
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
    slope = _slope(hull[start], hull[start + 1]) * 1e-3
    return hull[start], min(max(slope, -MAX_DRIFT), MAX_DRIFT)


def _slope(a: tuple[int, int], b: tuple[int, int]) -> float:
    return (b[1] - a[1]) / max(b[0] - a[0], 1)
