"""A recording in MCAP that stays readable when its writer is killed.

Chunks are small; they are closed by size and by age. A provisional end mark always follows the last chunk, and the next
chunk overwrites it: at any moment the file on disk is a complete MCAP file without index. When the file is closed,
index and summary replace the end mark.
"""

from __future__ import annotations

import fcntl
import os
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, cast

from mcap.data_stream import RecordBuilder
from mcap.records import DataEnd, Footer
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from hand_model.yaml_document import yaml_text
from hand_recording.bag_contents import Contents, Topic, TopicCount, metadata, qos_text, write_metadata
from hand_recording.chunk_index import ChunkIndexOnDisk

CHUNK_BYTES = 64 * 1024
CHUNK_AGE_NS = 500_000_000
_INDEXES = "_Writer__chunk_indices"
"""The list of the library that would keep the index of every chunk in memory."""


def _end_mark() -> bytes:
    """The shortest valid end of an MCAP file: no summary."""
    builder = RecordBuilder()
    DataEnd(0).write(builder)
    Footer(0, 0, 0).write(builder)
    return bytes(builder.end() + MCAP0_MAGIC)


END_MARK = _end_mark()


def claim(stream: BinaryIO) -> bool:
    """Lock a recording's file for this process while it is open; False where another process has locked it."""
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True  # a file system without locks
    return True


class _File:
    """The file of a recording: what is written waits in memory until it is settled with an end mark behind it."""

    def __init__(self, path: Path) -> None:
        """Create the file, which must not exist. Raises OSError."""
        self.raw = path.open("xb", buffering=0)
        claim(self.raw)
        self._waiting = bytearray()
        self._settled = 0

    def write(self, data: bytes) -> int:
        """Keep the bytes until settle or finish."""
        self._waiting += data
        return len(data)

    def tell(self) -> int:
        """Position of the next byte [bytes]."""
        return self._settled + len(self._waiting)

    def flush(self) -> None:
        """Nothing: chunk and end mark are written together."""

    def settle(self) -> None:
        """Give what waits and an end mark to the operating system. OSError: the file is as it was settled last."""
        self._put(self._waiting + END_MARK)
        self._settled += len(self._waiting)
        self._waiting.clear()

    def finish(self) -> None:
        """Write what waits, which ends with the end of the file, and close. OSError: see settle."""
        self._put(self._waiting)
        os.ftruncate(self.raw.fileno(), self.tell())
        self.raw.close()

    def _put(self, data: bytearray) -> None:
        done = 0
        try:
            while done < len(data):
                done += os.pwrite(self.raw.fileno(), memoryview(data)[done:], self._settled + done)
        except OSError:
            self._restore()
            raise

    def _restore(self) -> None:
        """Put the end mark back to where it was; its bytes exist on the disk, so that a full one has place for them."""
        with suppress(OSError):
            os.pwrite(self.raw.fileno(), END_MARK, self._settled)
            os.ftruncate(self.raw.fileno(), self._settled + len(END_MARK))


class McapBag:
    """A BagWriter of one file; `folder`: where metadata.yaml is written when it is closed, None: nowhere."""

    def __init__(self, path: Path, folder: Path | None) -> None:
        """Create the file `path`, which must not exist. Raises OSError."""
        self.path = path
        self.contents = Contents()
        self._folder = folder
        self._stream = _File(path)
        # This class closes the chunks, never the library, so that the end mark follows each of them.
        self._writer = Writer(cast(BinaryIO, self._stream), chunk_size=1 << 40, compression=CompressionType.LZ4)
        assert hasattr(self._writer, _INDEXES)  # otherwise the memory would grow with the recording
        setattr(self._writer, _INDEXES, ChunkIndexOnDisk(path))
        self._channels: dict[str, int] = {}
        self._schemas: dict[tuple[str, str], int] = {}
        self._open_bytes = 0
        self._now_ns = self._opened_ns = 0
        self._writer.start(profile="ros2", library="fluidic_hand")
        self._settle()

    @classmethod
    def file(cls, path: Path) -> McapBag:
        """A bare file NAME.mcap."""
        path.parent.mkdir(parents=True, exist_ok=True)
        return cls(path, None)

    @classmethod
    def folder(cls, path: Path) -> McapBag:
        """A rosbag2 folder NAME with NAME_0.mcap in it."""
        path.mkdir(parents=True)
        return cls(path / f"{path.name}_0.mcap", path)

    def add_topic(self, topic: Topic) -> None:
        """See BagWriter."""
        key = (topic.type, topic.definition)
        if key not in self._schemas:
            self._schemas[key] = self._writer.register_schema(topic.type, topic.encoding, topic.definition.encode())
        self._channels[topic.name] = self._writer.register_channel(
            topic.name,
            "cdr",
            self._schemas[key],
            {"offered_qos_profiles": qos_text(topic.qos), "topic_type_hash": topic.type_hash},
        )
        self.contents.topics[topic.name] = TopicCount(topic)

    def write(self, topic: str, raw: bytes, log_ns: int, publish_ns: int, sequence: int = 0) -> None:
        """See BagWriter."""
        if not self._open_bytes:
            self._opened_ns = self._now_ns
        self._writer.add_message(self._channels[topic], log_ns, raw, publish_ns, sequence & 0xFFFFFFFF)
        self.contents.topics[topic].add(log_ns, len(raw))
        self._open_bytes += len(raw)
        if self._open_bytes >= CHUNK_BYTES:
            self._settle()

    def tick(self, now_ns: int) -> None:
        """See BagWriter."""
        self._now_ns = now_ns
        if self._open_bytes and now_ns - self._opened_ns >= CHUNK_AGE_NS:
            self._settle()

    def close(self) -> None:
        """See BagWriter. Harmless when repeated.

        Raises OSError where the disk is full; the file then is complete up to its last chunk, without an index.
        """
        if self._stream.raw.closed:
            return
        content = metadata("mcap", self.path.name, self.contents)
        try:
            self._settle()
            self._writer.add_metadata("rosbag2", {"serialized_metadata": yaml_text(content)})
            self._writer.finish()
            self._stream.finish()
        finally:
            self._stream.raw.close()
        if self._folder:
            write_metadata(self._folder, content)

    def _settle(self) -> None:
        """Close the chunk and give everything to the operating system, with an end mark behind it."""
        self._open_bytes = 0
        self._writer.flush()
        self._stream.settle()
