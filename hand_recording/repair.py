"""Repairing a recording whose writer was killed: complete messages are kept, index and metadata are written again."""

from __future__ import annotations

import sqlite3
import struct
import zlib
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from io import BytesIO
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO

import yaml
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, Header, McapRecord, Message, Schema
from mcap.stream_reader import CRCValidationError, breakup_chunk
from mcap.writer import MCAP0_MAGIC
from rosbags.rosbag2.errors import ReaderError
from rosbags.rosbag2.metadata import parse_qos
from zstandard import ZstdCompressor, ZstdDecompressor, ZstdError

from hand_recording.bag_contents import (
    METADATA,
    BagError,
    Contents,
    Topic,
    TopicCount,
    joined,
    split_metadata,
    write_metadata,
)
from hand_recording.batches import ZSTD_MAGIC
from hand_recording.file_use import changes, user_of
from hand_recording.mcap_bag import McapBag, claim
from hand_recording.mcap_chunks import indexed_batches, is_indexed

PACKED = ".zstd"
"""What rosbag2 appends to the name of a file that it has compressed."""
_ENDINGS = (".mcap", ".db3", f".mcap{PACKED}", f".db3{PACKED}")
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


def repair(path: Path, watch_s: float = 0.0) -> Repair:
    """Repair the recording at `path`: a folder with any number of files, or a bare .mcap file.

    watch_s: time [s] for which files that changed lately are watched for further changes.
    An intact recording is not changed. Where bytes could not be read, the original file is kept next to the new one,
    `.damaged` appended to its name. Raises BagError where there is nothing to repair, or it is still being written.
    """
    if path.is_dir():
        files = _parts(path)
        _check_idle(files, watch_s)
        return _repair_folder(path, files)
    if not path.is_file():
        raise BagError(f"{path} does not exist")
    if path.suffix == ".db3":
        raise BagError(f"{path}: SQLite repairs the file itself when it is opened; repair its folder: {path.parent}")
    if path.suffix == PACKED:
        raise BagError(f"{path} is one compressed file of a recording; repair its folder: {path.parent}")
    if path.suffix != ".mcap":
        raise BagError(f"{path} is not an MCAP file; only .mcap files and recording folders can be repaired")
    _check_idle([path], watch_s)
    part = _mend_mcap(path)
    return _outcome(path, [part], part.changed)


def _check_idle(files: Sequence[Path], watch_s: float) -> None:
    """Raises BagError where a file is open elsewhere or changes; rosbag2 takes no lock."""
    for file in files:
        process = user_of(file)
        if process is not None:
            raise BagError(f"{file} is still being recorded or read: process {process} has it open")
    changing = changes(files, watch_s)
    if changing is not None:
        raise BagError(f"{changing} is still being recorded: it changes")


@dataclass(frozen=True)
class _Part:
    """One file of a recording after its repair: file name, contents, and as in Repair."""

    name: str
    contents: Contents
    lost_bytes: int = 0
    damaged: Path | None = None
    changed: bool = False


def _outcome(path: Path, parts: Sequence[_Part], changed: bool) -> Repair:
    contents = joined([part.contents for part in parts])
    messages = {name: count.messages for name, count in contents.topics.items()}
    damaged = next((part.damaged for part in parts if part.damaged), None)
    return Repair(path, messages, sum(part.lost_bytes for part in parts), damaged, changed)


def _parts(folder: Path) -> list[Path]:
    """The files of a recording in their order, those that rosbag2 compressed included. Raises BagError."""
    files = [file for ending in _ENDINGS for file in folder.glob(f"*{ending}")]
    if not files:
        raise BagError(f"{folder} holds 0 recording files; a folder with at least one can be repaired")
    kinds = {_plain_name(file).rpartition(".")[2] for file in files}
    if len(kinds) > 1:
        raise BagError(f"{folder} holds files of several kinds, .mcap and .db3; repair each in a folder of its own")
    return sorted(files, key=_number)


def _plain_name(file: Path) -> str:
    return file.name.removesuffix(PACKED)


def _number(file: Path) -> tuple[int, str, bool]:
    """Order of the parts NAME_0, NAME_1, ... NAME_10; of one part, the file that is not compressed comes first."""
    number = _plain_name(file).rpartition(".")[0].rpartition("_")[2]
    return int(number) if number.isdecimal() else 0, _plain_name(file), file.suffix == PACKED


def _repair_folder(folder: Path, files: Sequence[Path]) -> Repair:
    """Repair every file, leave out those without a message that never began, and write metadata.yaml again."""
    packed = any(file.suffix == PACKED for file in files)
    plain = {file.name for file in files if file.suffix != PACKED and file.stat().st_size}
    # A file was never begun, or was being compressed when the recorder ended.
    unused = [
        file for file in files if not file.stat().st_size or file.name.removesuffix(PACKED) in plain - {file.name}
    ]
    if len(unused) == len(files):
        raise BagError(f"{folder} holds only empty recording files (0 bytes); there is nothing to repair")
    for file in unused:
        file.replace(file.with_name(file.name + ".damaged"))
    done = []
    for file in files:
        if file not in unused:
            part = _mend_packed(file) if file.suffix == PACKED else _mend(file)
            if packed and file.suffix != PACKED:
                part = replace(part, name=_pack(file).name, changed=True)
            done.append(part)
    if packed:
        for part in done:
            part.contents.compression = "FILE"
    changed = bool(unused) or any(part.changed for part in done) or not _described(folder, done)
    if changed:
        storage = "mcap" if files[0].name.removesuffix(PACKED).endswith(".mcap") else "sqlite3"
        write_metadata(folder, split_metadata(storage, {part.name: part.contents for part in done}))
    return _outcome(folder, done, changed)


def _described(folder: Path, parts: Sequence[_Part]) -> bool:
    """Whether metadata.yaml exists, lists these files, and states their number of messages and compression."""
    try:
        content = yaml.safe_load((folder / METADATA).read_text(encoding="utf-8"))["rosbag2_bagfile_information"]
        listed = [PurePath(name).name for name in content["relative_file_paths"]]
        mode = str(content.get("compression_mode") or "").upper().replace("NONE", "")
        count = content["message_count"]
    except (OSError, UnicodeDecodeError, yaml.YAMLError, KeyError, TypeError, AttributeError):
        return False
    contents = joined([part.contents for part in parts])
    stated = listed == [part.name for part in parts] and count == contents.messages
    return stated and mode in (contents.compression, "STORAGE")


def _mend(file: Path) -> _Part:
    return _mend_mcap(file) if file.suffix == ".mcap" else _mend_sqlite(file)


def _mend_packed(file: Path) -> _Part:
    """Repair a compressed file through a copy that is not; it is compressed again only where it was damaged."""
    with TemporaryDirectory(dir=file.parent, prefix=".repair_") as scratch:
        plain = Path(scratch) / _plain_name(file)
        lost = 0
        with file.open("rb") as source, plain.open("wb") as target:
            try:
                ZstdDecompressor().copy_stream(source, target)
            except ZstdError:
                lost = file.stat().st_size - source.tell() or 1
        if plain.stat().st_size == 0:
            raise BagError(f"{file} cannot be decompressed; remove it from the folder to repair the rest")
        part = _mend(plain)
        if not part.changed and not lost:
            return replace(part, name=file.name, damaged=None)
        damaged = file.with_name(file.name + ".damaged")
        file.replace(damaged)
        packed = _pack(plain)
        packed.replace(file)
        return replace(part, name=file.name, lost_bytes=part.lost_bytes + lost, damaged=damaged, changed=True)


def _pack(file: Path) -> Path:
    """Compress a file as rosbag2 does, NAME.zstd, and remove it."""
    packed = file.with_name(file.name + PACKED)
    new = file.with_name(packed.name + ".new")
    with file.open("rb") as source, new.open("wb") as target:
        ZstdCompressor().copy_stream(source, target)
    new.replace(packed)
    file.unlink()
    return packed


def _mend_mcap(path: Path) -> _Part:
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
            bag.contents.compression = "MESSAGE" if scan.compressed else ""
            bag.close()
        except BaseException:
            new.unlink(missing_ok=True)
            raise
    if scan.intact and _summary_agrees(path, bag.contents):
        new.unlink()
        return _Part(path.name, bag.contents)
    damaged = path.with_name(path.name + ".damaged") if scan.lost_bytes else None
    if damaged:
        path.replace(damaged)
    new.replace(path)
    return _Part(path.name, bag.contents, scan.lost_bytes, damaged, changed=True)


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
        self.compressed = False  # rosbag2 has compressed each message
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
                self.compressed |= record.data[:4] == ZSTD_MAGIC
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


def _mend_sqlite(path: Path) -> _Part:
    """SQLite itself rolls back what was not committed."""
    contents = Contents()
    try:
        with closing(sqlite3.connect(path)) as database:
            rows = database.execute(
                "SELECT topics.name, topics.type, topics.type_description_hash, topics.offered_qos_profiles,"
                " count(messages.id), min(messages.timestamp), max(messages.timestamp),"
                " sum(length(messages.data)), min(substr(messages.data, 1, 4))"
                " FROM topics LEFT JOIN messages ON topics.id = messages.topic_id"
                " GROUP BY topics.id ORDER BY topics.id"
            ).fetchall()
    except sqlite3.Error as error:
        raise BagError(f"{path} is not a recording that can be repaired: {error}") from error
    for name, type_name, type_hash, qos, messages, first_ns, last_ns, size, head in rows:
        topic = Topic(name, type_name, "", type_hash, tuple(parse_qos(qos)))
        contents.topics[name] = TopicCount(topic, messages, size or 0, first_ns or 0, last_ns or 0)
        if head == ZSTD_MAGIC:
            contents.compression = "MESSAGE"
    return _Part(path.name, contents)
