"""Messages between their receipt and the file: put in order of receipt, and counted.

Subscriptions are emptied one after the other, so that a batch comes sorted by topic. Readers of a file
without index demand rising log times; so what arrived after the round began waits for the next one.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from hand_recording.bag_writer import BagWriter

# A clock set back by more than this is believed; less is jitter between topics and levelled.
STEP_NS = 1_000_000_000


@dataclass(order=True)
class Arrival:
    """One received message; orders by log time."""

    log_ns: int
    topic: str = field(compare=False)
    raw: bytes = field(compare=False)
    publish_ns: int = field(compare=False)
    sequence: int = field(compare=False)


class Arrivals:
    """Collects arrivals and writes them in order of receipt."""

    def __init__(self, bag: BagWriter) -> None:
        self.missed: dict[str, int] = {}
        self._bag = bag
        self._waiting: list[Arrival] = []
        self._last_ns = 0
        self._sequences: dict[str, int] = {}

    def add(self, arrival: Arrival, one_publisher: bool) -> None:
        """Take one message. With one publisher a gap in its sequence numbers is a loss, and counted."""
        before = self._sequences.get(arrival.topic, 0)
        if one_publisher and 0 < before < arrival.sequence - 1:
            gap = arrival.sequence - 1 - before
            self.missed[arrival.topic] = self.missed.get(arrival.topic, 0) + gap
        self._sequences[arrival.topic] = arrival.sequence
        self._waiting.append(arrival)

    def write(self, until_ns: int) -> None:
        """Write what was received by until_ns [ns, the clock of log times]."""
        self._waiting.sort()
        ready = [arrival for arrival in self._waiting if arrival.log_ns <= until_ns]
        self._waiting = self._waiting[len(ready) :]
        for arrival in ready:
            if 0 < self._last_ns - arrival.log_ns < STEP_NS:
                arrival.log_ns = self._last_ns
            self._last_ns = arrival.log_ns
            self._bag.write(arrival.topic, arrival.raw, arrival.log_ns, arrival.publish_ns, arrival.sequence)
