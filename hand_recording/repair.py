"""Repairing a recording whose writer was killed: complete messages are kept, index and metadata are written again."""

from __future__ import annotations

import sqlite3
import struct
import zlib
from collections.abc import Iterator
from contextlib import closing
from dataclasses import asdict, dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, Header, McapRecord, Message, Schema
from mcap.stream_reader import CRCValidationError, breakup_chunk
from mcap.writer import MCAP0_MAGIC
from rosbags.rosbag2.errors import ReaderError
from rosbags.rosbag2.metadata import parse_qos
from zstandard import ZstdError

from hand_recording.bag_contents import (
    METADATA,
    BagError,
    Contents,
    Topic,
    TopicCount,
    metadata,
    write_metadata,
)
from hand_recording.mcap_bag import McapBag, claim
from hand_recording.mcap_chunks import indexed_batches, is_indexed

_RECORD = struct.Struct("<BQ")  # opcode and length before every record
# What the library and the decompressors (lz4: RuntimeError) raise on damaged bytes.
_BROKEN = (
    McapError,
    CRCValidationError,
    ZstdError,
    RuntimeError,
    struct.error,
    ValueError,
    KeyError,
    OverflowError,
    MemoryError,
    OSError,
)
_READ: dict[int, type[Any]] = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.CHUNK: Chunk,
}


@dataclass(frozen=True)
class Repair:
    """The outcome of a repair.

    messages: number of messages kept, by topic.  lost_bytes: bytes of the file that could not be read.
    damaged: the file as it was, where bytes were lost.  changed: whether anything was written.
    """

    path: Path
    messages: dict[str, int]
    lost_bytes: int
    damaged: Path | None
    changed: bool

    def as_json(self) -> dict[str, Any]:
        """For json.dumps."""
        return {**asdict(self), "path": str(self.path), "damaged": self.damaged and str(self.damaged)}


def repair(path: Path) -> Repair:
    """Repair the recording at `path`: a folder, or a bare .mcap file.

    An intact recording is not changed. Where bytes could not be read, the original file is kept next to the new one,
    `.damaged` appended to its name. Raises BagError where there is nothing to repair.
    """
    if path.is_dir():
        return _repair_folder(path)
    if not path.is_file():
        raise BagError(f"{path} does not exist")
    if path.suffix != ".mcap":
        raise BagError(f"{path} is not an MCAP file; only .mcap files and recording folders can be repaired")
    return _repair_mcap(path, None)


def _repair_folder(folder: Path) -> Repair:
    files = [file for suffix in ("*.mcap", "*.db3") for file in sorted(folder.glob(suffix))]
    if len(files) != 1:
        raise BagError(f"{folder} holds {len(files)} recording files; a folder with exactly one can be repaired")
    if files[0].suffix == ".mcap":
        return _repair_mcap(files[0], folder)
    return _repair_sqlite(files[0], folder)


def _repair_mcap(path: Path, folder: Path | None) -> Repair:
    scan = _Scan()
    new = path.with_name(path.name + ".new")
    new.unlink(missing_ok=True)
    with path.open("rb") as stream:
        if not claim(stream):
            raise BagError(f"{path} is still being recorded")
        if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise BagError(f"{path} is not an MCAP file: it does not begin with the MCAP magic")
        bag = McapBag(new, None)
        try:
            for record in scan.records(stream, path.stat().st_size):
                scan.copy(record, bag)
            bag.close()
        except BaseException:
            new.unlink(missing_ok=True)
            raise
    messages = {name: count.messages for name, count in bag.contents.topics.items()}
    if scan.intact and _summary_agrees(path, bag.contents) and (folder is None or (folder / METADATA).is_file()):
        new.unlink()
        return Repair(path, messages, 0, None, changed=False)
    damaged = path.with_name(path.name + ".damaged") if scan.lost_bytes else None
    if damaged:
        path.replace(damaged)
    new.replace(path)
    if folder:
        write_metadata(folder, metadata("mcap", path.name, bag.contents))
    return Repair(path, messages, scan.lost_bytes, damaged, changed=True)


def _summary_agrees(path: Path, contents: Contents) -> bool:
    """Whether the file's summary and index are undamaged and list exactly the messages of the file."""
    with path.open("rb") as stream:
        try:
            summary = make_reader(stream).get_summary()
            if summary is None or summary.statistics is None or not _summary_crc_holds(stream, path.stat().st_size):
                return False
            if is_indexed(summary):
                return sum(len(batch.starts) for batch in indexed_batches(stream, summary, lambda _: True)) == (
                    contents.messages
                )
        except _BROKEN:
            return False
    return int(summary.statistics.message_count) == contents.messages


def _summary_crc_holds(stream: BinaryIO, size: int) -> bool:
    """The footer ends with a checksum (0: none) of the bytes from the start of the summary to the checksum itself."""
    end = size - len(MCAP0_MAGIC) - 4
    stream.seek(end - 16)
    summary_start, _, crc = struct.unpack("<QQI", stream.read(20))
    stream.seek(summary_start)
    return crc in (0, zlib.crc32(stream.read(end - summary_start)))


class _Scan:
    """Reads the complete records of an MCAP file from front to back and copies them into a new file."""

    def __init__(self) -> None:
        self.lost_bytes = 0
        self.intact = True  # every record is complete and consistent, up to the footer and the closing magic
        self._chunked = False
        self._schemas: dict[int, Schema] = {}
        self._topics: dict[int, str] = {}

    def records(self, stream: BinaryIO, size: int) -> Iterator[McapRecord]:
        """Schemas, channels and messages in file order."""
        opcode = 0
        while opcode != Opcode.FOOTER:
            start = stream.tell()
            head = stream.read(_RECORD.size)
            opcode, length = _RECORD.unpack(head) if len(head) == _RECORD.size else (0, size)
            if start + _RECORD.size + length > size:
                self._lose(size - start)
                return
            body = stream.read(length)
            self.intact &= opcode == Opcode.HEADER or start > len(MCAP0_MAGIC)
            try:
                yield from self._read(opcode, head, body)
            except _BROKEN:
                self._lose(_RECORD.size + length)
        if stream.read() != MCAP0_MAGIC:
            self._lose(size - start - _RECORD.size - length)

    def _lose(self, count: int) -> None:
        self.lost_bytes += count
        self.intact = False

    def _read(self, opcode: int, head: bytes, body: bytes) -> list[McapRecord]:
        stream = ReadDataStream(BytesIO(body))
        if opcode == Opcode.MESSAGE:
            if self._chunked:
                raise McapError("a message between chunks is a damaged chunk")
            return [Message.read(stream, len(body))]
        if opcode not in _READ:
            return []
        record = _READ[opcode].read(stream)
        again = RecordBuilder()
        record.write(again)
        self.intact &= again.end() == head + body  # the lengths within the record agree with its own length
        if isinstance(record, Header):
            self.intact &= record.profile == "ros2"
        if not isinstance(record, Chunk):
            return [record]
        self._chunked = True
        records: list[McapRecord] = breakup_chunk(record, validate_crc=True)
        times = [part.log_time for part in records if isinstance(part, Message)] or [0]
        self.intact &= (record.message_start_time, record.message_end_time) == (min(times), max(times))
        return records

    def copy(self, record: McapRecord, bag: McapBag) -> None:
        """Write a record to the new file."""
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            self._add_channel(record, bag)
        elif isinstance(record, Message):
            topic = self._topics.get(record.channel_id)
            if topic is None:
                self._lose(len(record.data))
            else:
                bag.write(topic, record.data, record.log_time, record.publish_time, record.sequence)

    def _add_channel(self, channel: Channel, bag: McapBag) -> None:
        schema = self._schemas.get(channel.schema_id)
        if schema is None:
            return
        self._topics[channel.id] = channel.topic
        if channel.topic in bag.contents.topics:
            return
        try:
            qos = tuple(parse_qos(channel.metadata.get("offered_qos_profiles", "")))
        except (ReaderError, KeyError, TypeError):
            qos = ()
        type_hash = channel.metadata.get("topic_type_hash", "")
        text = schema.data.decode(errors="replace")
        bag.add_topic(Topic(channel.topic, schema.name, text, type_hash, qos, schema.encoding))


def _repair_sqlite(path: Path, folder: Path) -> Repair:
    """SQLite itself rolls back what was not committed; metadata.yaml is written again."""
    contents = Contents()
    try:
        with closing(sqlite3.connect(path)) as database:
            rows = database.execute(
                "SELECT topics.name, topics.type, topics.type_description_hash, topics.offered_qos_profiles,"
                " count(messages.id), min(messages.timestamp), max(messages.timestamp),"
                " sum(length(messages.data))"
                " FROM topics LEFT JOIN messages ON topics.id = messages.topic_id"
                " GROUP BY topics.id ORDER BY topics.id"
            ).fetchall()
    except sqlite3.Error as error:
        raise BagError(f"{path} is not a recording that can be repaired: {error}") from error
    for name, type_name, type_hash, qos, messages, first_ns, last_ns, size in rows:
        topic = Topic(name, type_name, "", type_hash, tuple(parse_qos(qos)))
        contents.topics[name] = TopicCount(topic, messages, size or 0, first_ns or 0, last_ns or 0)
    counts = {name: count.messages for name, count in contents.topics.items()}
    if (folder / METADATA).is_file():
        return Repair(path, counts, 0, None, changed=False)
    write_metadata(folder, metadata("sqlite3", path.name, contents))
    return Repair(path, counts, 0, None, changed=True)
