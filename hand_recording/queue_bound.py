"""How many messages of a topic the middleware may queue for the recorder: bounded in number and in bytes.

A subscription has a limit by number only. So the recorder learns the size of a topic's messages from the first of them
on, and subscribes again with a shorter queue where QUEUE messages of that size would exceed QUEUE_BYTES. What a full
queue drops shows in the sequence numbers and is counted as missed.
"""

from __future__ import annotations

QUEUE = 2000
"""Most messages of a topic between two rounds: seconds at any rate in use."""
QUEUE_BYTES = 32 * 1024 * 1024
"""Most bytes of a topic between two rounds; one message may be larger."""
ROUND_BYTES = 64 * 1024 * 1024
"""Bytes that a round takes before it writes them; one message may be larger."""


class QueueBound:
    """The queues of all topics of a recording."""

    def __init__(self) -> None:
        """Begin without knowledge of any size: every topic has the whole queue."""
        self._largest: dict[str, int] = {}
        self._depth: dict[str, int] = {}

    def depth(self, topic: str) -> int:
        """Messages that the queue of a topic may hold."""
        return self._depth.get(topic, QUEUE)

    def shortened(self, topic: str, size: int) -> bool:
        """Take the size [bytes] of a message; whether the queue of its topic must become shorter."""
        if size <= self._largest.get(topic, 0):
            return False
        self._largest[topic] = size
        if self.depth(topic) * size <= QUEUE_BYTES:
            return False
        before, self._depth[topic] = self.depth(topic), max(QUEUE_BYTES // (2 * size), 1)  # half: sizes may still grow
        return self._depth[topic] < before

    def line(self, topic: str) -> str:
        """Why the queue of a topic is short, and how short it is."""
        return (
            f"its messages have up to {self._largest[topic] / 1e6:.3g} MB: at most {self._depth[topic]} of them wait to"
            " be written, and more that arrive meanwhile are missed"
        )

    def lines(self) -> dict[str, str]:
        """The same of every topic whose queue is short."""
        return {topic: self.line(topic) for topic in self._depth}
