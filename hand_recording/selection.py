"""Which topics of the graph belong into a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

ALWAYS = ("/diagnostics", "/clock")


@dataclass(frozen=True)
class Selection:
    """Namespaces to record in full, and topics by name. Names of topics replace the namespaces."""

    namespaces: tuple[str, ...] = ("/hand",)
    topics: tuple[str, ...] = ()
    rosout: bool = False

    def wants(self, topic: str) -> bool:
        """Whether the topic (fully qualified) is recorded. Hidden topics are only recorded by name."""
        if self.topics:
            return topic in map(_absolute, self.topics)
        if any(part.startswith("_") for part in topic.split("/")):
            return False
        if topic in ALWAYS or (self.rosout and topic == "/rosout"):
            return True
        return any(topic.startswith(_absolute(space).rstrip("/") + "/") for space in self.namespaces)

    def choose(self, graph: Sequence[tuple[str, Sequence[str]]]) -> dict[str, Sequence[str]]:
        """The wanted topics of a graph listing (name, types) and their types."""
        return {name: types for name, types in graph if self.wants(name)}


def _absolute(name: str) -> str:
    return name if name.startswith("/") else f"/{name}"
