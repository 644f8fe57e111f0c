"""Bounds on what arrives, checked before it is decoded: bytes, entries of lists, messages a second.

Whoever is on the domain can publish a message of any size at any rate. A message of a hand is small, so that one that
is larger than MAX_BYTES, or names more than MAX_NAMES, is refused after a look at its first bytes. Times are arguments.
"""

from __future__ import annotations

import reprlib

MAX_BYTES = 65_536
"""Largest message of a hand that is decoded [bytes]; a hand of 255 joints needs less than half."""
MAX_NAMES = 256
"""Most entries of a list of names that are decoded: those of a whole robot, too."""
SHOWN_NAMES = 16
"""Most names that an error lists."""
COMMAND_RATE_HZ = 1000.0
"""Commands a second that are read, on each topic; more are dropped unread."""
COMMAND_BURST = 100
"""Commands that may arrive at once."""
SHOWN_S = 5.0
"""Time for which dropped messages are reported."""

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 60


class BoundError(ValueError):
    """A message is too large to be decoded; the message of the error is one line."""


def check_bytes(size: int, most: int = MAX_BYTES) -> None:
    """Raises BoundError where a message of `size` bytes exceeds `most` bytes."""
    if size > most:
        raise BoundError(f"the message has {size} bytes; at most {most} are allowed")


def shown(value: object) -> str:
    """The value as repr shows it, cut to one short line: what arrives must not fill logs and diagnostics."""
    return _SHORT.repr(value)


def listed(names: tuple[str, ...] | list[str]) -> str:
    """The first names of a list, each cut, for one line."""
    texts = [name if len(name) <= 60 and name.isprintable() else shown(name) for name in names[:SHOWN_NAMES]]
    more = len(names) - SHOWN_NAMES
    return ", ".join(texts) + (f" and {more} more" if more > 0 else "")


class Budget:
    """Messages of one topic that are read: `rate_hz` a second over time and up to `burst` at once."""

    def __init__(self, rate_hz: float = COMMAND_RATE_HZ, burst: int = COMMAND_BURST) -> None:
        """Begin with the whole burst unused."""
        self._rate_hz = rate_hz
        self._most = float(burst)
        self._left = float(burst)
        self._last_s = -1.0
        self._dropped_s = -1e9
        self.dropped = 0

    def take(self, now_s: float) -> bool:
        """Whether a message that arrives at now_s (a monotonic clock, [s]) is to be read; otherwise it is counted."""
        passed_s = max(now_s - self._last_s, 0.0) if self._last_s >= 0.0 else 0.0
        self._left = min(self._left + passed_s * self._rate_hz, self._most)
        self._last_s = now_s
        if self._left >= 1.0:
            self._left -= 1.0
            return True
        self.dropped += 1
        self._dropped_s = now_s
        return False

    def problem(self, now_s: float, shown_s: float = SHOWN_S) -> str:
        """One line while messages were dropped within the last shown_s [s]; otherwise empty."""
        if now_s - self._dropped_s > shown_s:
            return ""
        return (
            f"more than {self._rate_hz:g} messages a second arrive, the rest is dropped unread;"
            " find the publisher with: ros2 topic info --verbose"
        )
