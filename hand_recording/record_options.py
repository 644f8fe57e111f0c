"""What to record, and the figures of a finished recording."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from hand_recording.bag_contents import Contents, TopicCount

ALWAYS = ("/diagnostics", "/clock", "/tf", "/tf_static")
"""Topics that are recorded in addition to the chosen namespaces."""


@dataclass(frozen=True)
class Selection:
    """Which topics of the graph are recorded.

    namespaces: every topic below these is recorded.  topics: where given, only these topics are recorded.
    rosout: whether /rosout is recorded too.
    """

    namespaces: tuple[str, ...] = ("/hand",)
    topics: tuple[str, ...] = ()
    rosout: bool = False

    def wants(self, topic: str) -> bool:
        """Whether the topic (fully qualified) is recorded. Hidden topics are recorded by name only."""
        if self.topics:
            return topic in map(_absolute, self.topics)
        if any(part.startswith("_") for part in topic.split("/")):
            return False
        if topic in ALWAYS or (self.rosout and topic == "/rosout"):
            return True
        return any(topic.startswith(_absolute(space).rstrip("/") + "/") for space in self.namespaces)

    def choose(self, graph: Sequence[tuple[str, Sequence[str]]]) -> dict[str, Sequence[str]]:
        """The chosen topics of a graph listing of (name, types), with their types."""
        return {name: types for name, types in graph if self.wants(name)}


def _absolute(name: str) -> str:
    return name if name.startswith("/") else f"/{name}"


@dataclass(frozen=True)
class RecordOptions:
    """A recording to make.

    out: new folder, or a file NAME.mcap.  storage: one of bag_writer.STORAGES.
    duration_s: length of the recording [s]; None: the caller ends it.
    """

    out: Path
    storage: str = "mcap"
    selection: Selection = field(default_factory=Selection)
    duration_s: float | None = None

    def __post_init__(self) -> None:
        """Check the duration. Raises ValueError where it is not a finite number above 0."""
        if self.duration_s is not None and not (math.isfinite(self.duration_s) and self.duration_s > 0):
            raise ValueError(f"duration {self.duration_s} s is not a finite number above 0")


@dataclass(frozen=True)
class TopicSummary:
    """One topic of a finished recording.

    bytes: of all serialized messages.  rate_hz: mean rate between the first and the last message.
    missed: messages that were published and not received, as far as their sequence numbers show it.
    """

    name: str
    type: str
    messages: int
    bytes: int
    rate_hz: float
    missed: int


@dataclass(frozen=True)
class RecordSummary:
    """A finished recording in numbers.

    skipped: topics that could not be recorded, with the reason.  limited: topics of which few messages may wait.
    """

    path: str
    duration_s: float
    topics: tuple[TopicSummary, ...]
    skipped: Mapping[str, str]
    limited: Mapping[str, str] = field(default_factory=dict)

    @property
    def messages(self) -> int:
        """Number of messages of all topics."""
        return sum(topic.messages for topic in self.topics)

    @property
    def bytes(self) -> int:
        """Serialized bytes of all topics."""
        return sum(topic.bytes for topic in self.topics)

    def as_json(self) -> dict[str, Any]:
        """The content for json.dumps."""
        return {**asdict(self), "messages": self.messages, "bytes": self.bytes}


def summarize(
    path: Path,
    duration_s: float,
    contents: Contents,
    missed: Mapping[str, int],
    skipped: Mapping[str, str],
    limited: Mapping[str, str],
) -> RecordSummary:
    """The summary of what was written so far. missed, skipped, limited: by topic, see TopicSummary, RecordSummary."""
    topics = tuple(
        TopicSummary(name, count.topic.type, count.messages, count.bytes, _rate_hz(count), missed.get(name, 0))
        for name, count in contents.topics.items()
    )
    return RecordSummary(str(path), duration_s, topics, dict(skipped), dict(limited))


def _rate_hz(count: TopicCount) -> float:
    span_ns = count.last_ns - count.first_ns
    return (count.messages - 1) * 1e9 / span_ns if span_ns > 0 else 0.0
