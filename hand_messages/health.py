"""The status of a node on /diagnostics, before it is converted to a message."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

DATA_LATE = "sensor data is late"
"""Status of a controller that drives its hand and waits for the next frame; it vents where that does not come."""


class Level(IntEnum):
    """Levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True, slots=True)
class Health:
    """One status: a part of the node, its level, a message of one line, and values by name."""

    name: str
    level: Level
    message: str
    values: dict[str, str] = field(default_factory=dict)

    @property
    def verdict(self) -> tuple[str, Level, str]:
        """The part of a status whose change is published at once; a change of the values alone is not."""
        return self.name, self.level, self.message


def worst(statuses: list[Health]) -> Level:
    """The most severe level, OK for none."""
    return max((status.level for status in statuses), default=Level.OK)
