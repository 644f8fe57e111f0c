"""Counting what is missing between frames."""

from __future__ import annotations

WRAP = 1 << 32
RESTART = 1 << 16
"""A jump larger than this is a board that started anew, not a loss."""


class SequenceGap:
    """Frames missing before each frame, from its 32-bit sequence number."""

    def __init__(self) -> None:
        """Begin with no frame."""
        self._last: int | None = None

    def missing_before(self, sequence: int) -> int:
        """How many frames were lost before this one; 0 for the first and after a restart of the board."""
        last, self._last = self._last, sequence
        if last is None:
            return 0
        gap = (sequence - last - 1) % WRAP
        return gap if gap < RESTART else 0
