"""What a recording contains, and the metadata.yaml that describes it: version 9, as ROS 2 Jazzy writes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rosbags.interfaces import Qos
from rosbags.rosbag2.metadata import dump_qos_v9

from hand_model.yaml_document import yaml_text
from hand_recording.message_types import definition

METADATA = "metadata.yaml"
METADATA_VERSION = 9


class BagError(ValueError):
    """A recording cannot be written or repaired as asked; the message is one line for the user."""


@dataclass(frozen=True)
class Topic:
    """A topic as a recording describes it.

    definition: text of the message type with all types it refers to.  type_hash: its RIHS01 hash (REP 2011).
    qos: the profiles that its publishers offer.  encoding: of the definition, as MCAP names it.
    """

    name: str
    type: str
    definition: str
    type_hash: str
    qos: tuple[Qos, ...] = ()
    encoding: str = "ros2msg"

    @classmethod
    def of(cls, name: str, type_name: str, qos: Sequence[Qos] = ()) -> Topic:
        """A topic of a known message type. Raises message_types.UnknownType."""
        return cls(name, type_name, *definition(type_name), tuple(qos))


@dataclass
class TopicCount:
    """What was written of a topic: number of messages, their bytes, earliest and latest log time [ns]."""

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
    """What was written of all topics, by topic name in the order of their first appearance.

    compression: "MESSAGE" where rosbag2 compressed each message, "FILE" where it compressed the files, else empty.
    """

    topics: dict[str, TopicCount] = field(default_factory=dict)
    compression: str = ""

    @property
    def messages(self) -> int:
        """Number of messages of all topics."""
        return sum(count.messages for count in self.topics.values())

    @property
    def span_ns(self) -> tuple[int, int]:
        """Earliest and latest log time [ns]; both 0 where there is no message."""
        counts = [count for count in self.topics.values() if count.messages]
        if not counts:
            return 0, 0
        return min(count.first_ns for count in counts), max(count.last_ns for count in counts)


def qos_text(qos: Sequence[Qos]) -> str:
    """Offered QoS profiles as rosbag2 stores them with an MCAP channel."""
    return yaml_text(dump_qos_v9(list(qos))).strip() if qos else ""


def joined(parts: Sequence[Contents]) -> Contents:
    """The contents of all parts of a split recording."""
    whole = Contents(compression=parts[0].compression if parts else "")
    for part in parts:
        for name, count in part.topics.items():
            known = whole.topics.setdefault(name, TopicCount(count.topic))
            if count.messages:
                first = min(known.first_ns, count.first_ns) if known.messages else count.first_ns
                known.first_ns, known.last_ns = first, max(known.last_ns, count.last_ns)
            known.messages += count.messages
            known.bytes += count.bytes
    return whole


def _extent(contents: Contents) -> dict[str, Any]:
    first_ns, last_ns = contents.span_ns
    return {
        "duration": {"nanoseconds": last_ns - first_ns},
        "starting_time": {"nanoseconds_since_epoch": first_ns},
        "message_count": contents.messages,
    }


def metadata(storage: str, file: str, contents: Contents) -> dict[str, Any]:
    """The content of metadata.yaml for a recording of one file. storage: mcap or sqlite3."""
    return split_metadata(storage, {file: contents})


def split_metadata(storage: str, parts: Mapping[str, Contents]) -> dict[str, Any]:
    """The content of metadata.yaml for a recording of several files, by name in their order."""
    contents = joined(list(parts.values()))
    extent = _extent(contents)
    return {
        "version": METADATA_VERSION,
        "storage_identifier": storage,
        **extent,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": count.topic.name,
                    "type": count.topic.type,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": dump_qos_v9(list(count.topic.qos)),
                    "type_description_hash": count.topic.type_hash,
                },
                "message_count": count.messages,
            }
            for count in contents.topics.values()
        ],
        "compression_format": "zstd" if contents.compression else "",
        "compression_mode": contents.compression,
        "relative_file_paths": list(parts),
        "files": [{"path": file, **_extent(part)} for file, part in parts.items()],
        "custom_data": None,
        "ros_distro": "jazzy",
    }


def write_metadata(folder: Path, content: dict[str, Any]) -> None:
    """Write FOLDER/metadata.yaml. The file appears complete or not at all."""
    new = folder / f"{METADATA}.new"
    new.write_text(yaml_text({"rosbag2_bagfile_information": content}), encoding="utf-8")
    new.replace(folder / METADATA)
