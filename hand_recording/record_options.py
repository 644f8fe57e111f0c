"""What to record, and what came of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from hand_recording.bag_contents import Contents, TopicCount
from hand_recording.selection import Selection


@dataclass(frozen=True)
class RecordOptions:
    """A recording to make. duration_s: None records until it is told to stop."""

    out: Path
    storage: str = "mcap"
    selection: Selection = field(default_factory=Selection)
    duration_s: float | None = None

    def __post_init__(self) -> None:
        """Raises ValueError for a duration that is none."""
        if self.duration_s is not None and not (math.isfinite(self.duration_s) and self.duration_s > 0):
            raise ValueError(f"duration {self.duration_s} s is not a finite number above 0")


@dataclass(frozen=True)
class TopicSummary:
    """One topic of a finished recording. missed: messages known to have been sent and not received."""

    name: str
    type: str
    messages: int
    bytes: int
    rate_hz: float
    missed: int


@dataclass(frozen=True)
class RecordSummary:
    """A recording in numbers. skipped: topics that could not be recorded, and why."""

    path: str
    duration_s: float
    topics: tuple[TopicSummary, ...]
    skipped: Mapping[str, str]

    @property
    def messages(self) -> int:
        """Messages of all topics."""
        return sum(topic.messages for topic in self.topics)

    @property
    def bytes(self) -> int:
        """Serialized bytes of all topics."""
        return sum(topic.bytes for topic in self.topics)

    def as_json(self) -> dict[str, Any]:
        """For json.dumps."""
        return {**asdict(self), "messages": self.messages, "bytes": self.bytes}


def summarize(
    path: Path, duration_s: float, contents: Contents, missed: Mapping[str, int], skipped: Mapping[str, str]
) -> RecordSummary:
    """The numbers of what was written so far."""
    topics = tuple(
        TopicSummary(name, count.topic.type, count.messages, count.bytes, _rate_hz(count), missed.get(name, 0))
        for name, count in contents.topics.items()
    )
    return RecordSummary(str(path), duration_s, topics, dict(skipped))


def _rate_hz(count: TopicCount) -> float:
    span_ns = count.last_ns - count.first_ns
    return (count.messages - 1) * 1e9 / span_ns if span_ns > 0 else 0.0
