"""Which messages of a topic come from the publisher that is followed: the numbers that DDS gives them show it.

Every DDS writer numbers its samples 1, 2, 3 ... (RTPS 2.5, 8.3.5.4), so the messages of two publishers cannot form one
rising sequence. This finds a second publisher in its first message, also before DDS has shown it; it does not say
which node that is. Times are nanoseconds of one monotonic clock and are arguments.
"""

from __future__ import annotations

SILENCE_S = 0.5
"""Without a message of the followed publisher for this time, the next one to publish is followed.

Longer than a busy node lets messages wait: of those that wait, only the newest is kept, whoever published it.
"""
SHOWN_S = 0.1
"""A message of another publisher is a disturbance for this time."""
MOST_HZ = 2000.0
"""Fastest rate of one publisher: messages that were lost in between let its numbers rise this fast at most."""
SLACK = 16
"""Numbers that may be skipped at once: messages that wait in queues arrive together."""
STALL_S, CAUGHT_UP_S = 0.02, 0.05
"""After a longer silence the node may have stood still: it then reads what has waited, first and last of it at once."""


class Stream:
    """The numbers of one topic's messages."""

    def __init__(self) -> None:
        """Follow whoever publishes first."""
        self._last = 0
        self._last_ns: int | None = None
        self._stranger_ns: int | None = None
        self._waited, self._waited_ns = 0.0, 0

    def take(self, number: int | None, now_ns: int) -> bool:
        """Whether a message with this number is from the followed publisher; always, where DDS gives no numbers."""
        if number is None:
            return True
        if self._last_ns is not None:
            silent_s = (now_ns - self._last_ns) * 1e-9
            skipped = number - self._last - 1
            waited = self._waited if now_ns - self._waited_ns <= CAUGHT_UP_S * 1e9 else 0.0
            if silent_s <= SILENCE_S and not 0 <= skipped <= SLACK + MOST_HZ * silent_s + waited:
                self._stranger_ns = now_ns
                return False
            if silent_s > STALL_S:
                self._waited, self._waited_ns = MOST_HZ * silent_s, now_ns
        self._last, self._last_ns = number, now_ns
        return True

    def disturbed(self, now_ns: int) -> bool:
        """Whether a message of another publisher came within the last SHOWN_S."""
        return self._stranger_ns is not None and now_ns - self._stranger_ns <= SHOWN_S * 1e9
