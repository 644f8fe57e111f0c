"""metadata.yaml of a rosbag2 recording, version 9, as ROS 2 Jazzy writes it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml
from rosbags.interfaces import Qos
from rosbags.rosbag2.metadata import dump_qos_v9

from hand_recording.bag_contents import Contents

VERSION = 9
NAME = "metadata.yaml"


def qos_text(qos: Sequence[Qos]) -> str:
    """Offered QoS profiles as rosbag2 stores them with a channel."""
    return yaml.safe_dump(dump_qos_v9(list(qos)), sort_keys=False).strip() if qos else ""


def information(storage: str, file: str, contents: Contents) -> dict[str, Any]:
    """The content of metadata.yaml for a recording of one file."""
    first_ns, last_ns = contents.span_ns
    extent = {
        "duration": {"nanoseconds": last_ns - first_ns},
        "starting_time": {"nanoseconds_since_epoch": first_ns},
        "message_count": contents.messages,
    }
    return {
        "version": VERSION,
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
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file],
        "files": [{"path": file, **extent}],
        "custom_data": None,
        "ros_distro": "jazzy",
    }


def information_text(content: dict[str, Any]) -> str:
    """The content as YAML, without the outer key."""
    return yaml.dump(content, Dumper=_NoAliases, sort_keys=False)


def write_metadata(folder: Path, content: dict[str, Any]) -> None:
    """Write FOLDER/metadata.yaml at once: it is there whole or not at all."""
    text = yaml.dump({"rosbag2_bagfile_information": content}, Dumper=_NoAliases, sort_keys=False)
    new = folder / f"{NAME}.new"
    new.write_text(text, encoding="utf-8")
    new.replace(folder / NAME)


class _NoAliases(yaml.SafeDumper):
    """Writes repeated parts in full: rosbag2 reads the file with a parser that others share."""

    def ignore_aliases(self, data: Any) -> bool:
        """Never refer back."""
        return True
