"""What a recording holds: its topics and what was written of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from rosbags.interfaces import Qos

from hand_recording.message_types import definition


class BagError(ValueError):
    """A recording cannot be written or mended as asked; the message is one line for its user."""


@dataclass(frozen=True)
class Topic:
    """A topic as a bag describes it; `qos` are the profiles its publishers offer."""

    name: str
    type: str
    definition: str
    type_hash: str
    qos: tuple[Qos, ...] = ()
    encoding: str = "ros2msg"

    @classmethod
    def of(cls, name: str, type_name: str, qos: Sequence[Qos] = ()) -> Topic:
        """A topic of a known type. Raises message_types.UnknownType."""
        return cls(name, type_name, *definition(type_name), tuple(qos))


@dataclass
class TopicCount:
    """What was written of a topic."""

    topic: Topic
    messages: int = 0
    bytes: int = 0
    first_ns: int = 0
    last_ns: int = 0

    def add(self, log_ns: int, size: int) -> None:
        """Count a message of `size` bytes logged at log_ns [ns]."""
        if not self.messages:
            self.first_ns = self.last_ns = log_ns
        self.messages += 1
        self.bytes += size
        self.first_ns = min(self.first_ns, log_ns)
        self.last_ns = max(self.last_ns, log_ns)


@dataclass
class Contents:
    """What was written in all, by topic name in order of first appearance."""

    topics: dict[str, TopicCount] = field(default_factory=dict)

    @property
    def messages(self) -> int:
        """Messages of all topics."""
        return sum(count.messages for count in self.topics.values())

    @property
    def span_ns(self) -> tuple[int, int]:
        """Earliest and latest log time [ns]; both 0 when there is no message."""
        counts = [count for count in self.topics.values() if count.messages]
        if not counts:
            return 0, 0
        return min(count.first_ns for count in counts), max(count.last_ns for count in counts)
