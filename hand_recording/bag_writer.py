"""Writing a recording: the protocol of both storages, how to open one, and the order in which messages are written.

Times are nanoseconds. The log time of a message is when it was received, its publish time when it was sent.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from hand_recording.bag_contents import BagError, Contents, Topic
from hand_recording.mcap_bag import McapBag
from hand_recording.sqlite_bag import SqliteBag

__all__ = ["STORAGES", "Arrival", "Arrivals", "BagError", "BagWriter", "Contents", "Topic", "open_bag"]

STORAGES = ("mcap", "sqlite3")
STEP_NS = 1_000_000_000
"""A log time that is earlier than the previous one by less than this is raised to it; a larger step is a clock that
was set back, and is written as it is."""


class BagWriter(Protocol):
    """A recording that is being written."""

    @property
    def contents(self) -> Contents:
        """What was written so far."""

    def add_topic(self, topic: Topic) -> None:
        """Declare a topic; once, before its first message."""

    def write(self, topic: str, raw: bytes, log_ns: int, publish_ns: int, sequence: int = 0) -> None:
        """Append one serialized message. SQLite3 has no place for publish_ns and sequence."""

    def tick(self, now_ns: int) -> None:
        """Hand what is older than half a second to the operating system. now_ns: a monotonic clock."""

    def close(self) -> None:
        """Finish the files and write metadata.yaml."""


def open_bag(out: Path, storage: str = "mcap") -> BagWriter:
    """Start a recording: the folder `out`, or one bare file where its name ends with .mcap.

    storage: one of STORAGES.  Raises BagError where `out` exists, cannot be made or does not go with the storage.
    """
    if storage not in STORAGES:
        raise BagError(f"storage {storage!r} is unknown; allowed: {', '.join(STORAGES)}")
    if out.exists():
        raise BagError(f"{out} exists already; recordings are never overwritten")
    if storage == "sqlite3" and out.suffix in (".mcap", ".db3"):
        raise BagError(f"{out}: a SQLite3 recording is a folder; give a name without {out.suffix}")
    try:
        if storage == "sqlite3":
            return SqliteBag(out)
        return McapBag.file(out) if out.suffix == ".mcap" else McapBag.folder(out)
    except OSError as error:
        raise BagError(f"{out} cannot be written: {error.strerror}") from error


@dataclass(order=True)
class Arrival:
    """One received message, ordered by its log time. sequence: the publisher's number, 0 where it is not known."""

    log_ns: int
    topic: str = field(compare=False)
    raw: bytes = field(compare=False)
    publish_ns: int = field(compare=False)
    sequence: int = field(compare=False)


class Arrivals:
    """Received messages, written in the order of their log times and counted.

    The recorder empties its subscriptions one after the other, so a batch arrives sorted by topic, while readers of a
    file without index need rising log times. A message that arrived after a round began is written in the next round.
    """

    def __init__(self, bag: BagWriter) -> None:
        self.missed: dict[str, int] = {}
        self._bag = bag
        self._waiting: list[Arrival] = []
        self._last_ns = 0
        self._sequences: dict[str, int] = {}

    def add(self, arrival: Arrival, one_publisher: bool) -> None:
        """Take one message. Where its topic has one publisher, a gap in the sequence numbers is counted as missed."""
        before = self._sequences.get(arrival.topic, 0)
        if one_publisher and 0 < before < arrival.sequence - 1:
            gap = arrival.sequence - 1 - before
            self.missed[arrival.topic] = self.missed.get(arrival.topic, 0) + gap
        self._sequences[arrival.topic] = arrival.sequence
        self._waiting.append(arrival)

    def write(self, until_ns: int) -> None:
        """Write the messages received by until_ns [ns, the clock of the log times]."""
        self._waiting.sort()
        ready = [arrival for arrival in self._waiting if arrival.log_ns <= until_ns]
        self._waiting = self._waiting[len(ready) :]
        for arrival in ready:
            if 0 < self._last_ns - arrival.log_ns < STEP_NS:
                arrival.log_ns = self._last_ns
            self._last_ns = arrival.log_ns
            self._bag.write(arrival.topic, arrival.raw, arrival.log_ns, arrival.publish_ns, arrival.sequence)
