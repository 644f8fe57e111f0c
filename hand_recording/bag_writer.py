"""Writing a recording: the protocol that both storages answer, and how to open one.

Times are nanoseconds. A log time is when a message was received, a publish time when it was sent.
"""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from hand_recording.bag_contents import BagError, Contents, Topic
from hand_recording.mcap_bag import McapBag
from hand_recording.sqlite_bag import SqliteBag

__all__ = ["STORAGES", "BagError", "BagWriter", "Contents", "Topic", "open_bag"]

STORAGES = ("mcap", "sqlite3")


class BagWriter(Protocol):
    """A recording being written."""

    @property
    def contents(self) -> Contents:
        """What was written so far."""

    def add_topic(self, topic: Topic) -> None:
        """Make a topic known; once, before its first message."""

    def write(self, topic: str, raw: bytes, log_ns: int, publish_ns: int, sequence: int = 0) -> None:
        """Append one serialized message. SQLite3 has no place for publish_ns and sequence."""

    def tick(self, now_ns: int) -> None:
        """Hand what is older than half a second to the operating system. now_ns: a monotonic clock."""

    def close(self) -> None:
        """Finish the files and write metadata.yaml."""


def open_bag(out: Path, storage: str = "mcap") -> BagWriter:
    """Start a recording: the folder `out`, or one bare file when its name ends with .mcap.

    Raises BagError when `out` exists, cannot be made or does not go with the storage.
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
