"""Reading the messages of a recording of any storage, in bulk or one by one."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import apsw
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.stream_reader import CRCValidationError
from rosbags.interfaces import MessageDefinitionFormat
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.errors import ReaderError
from zstandard import ZstdError

from hand_recording.batches import Batch, RawMessage, RawTopic, Wanted, gather, plain, plain_batch
from hand_recording.mcap_chunks import indexed_batches, is_indexed, topics_of
from hand_recording.recording_files import RecordingError, RecordingFiles, damaged, locate

# What the libraries raise on damaged bytes (lz4: RuntimeError).
_LIBRARY_ERRORS = (
    McapError,
    CRCValidationError,
    ZstdError,
    ReaderError,
    apsw.Error,
    RuntimeError,
    struct.error,
    ValueError,
    KeyError,
    TypeError,
    OverflowError,
    MemoryError,
    OSError,
)


@contextmanager
def _one_line(file: Path) -> Iterator[None]:
    """Turn what a library raises on damaged bytes into a RecordingError."""
    try:
        yield
    except RecordingError:
        raise
    except _LIBRARY_ERRORS as error:
        raise damaged(file, error) from error


def list_topics(path: Path) -> list[RawTopic]:
    """Every topic of a recording. Raises RecordingError."""
    found = locate(path)
    if found.storage == ".mcap" and not found.compressed:
        topics: dict[RawTopic, None] = {}
        for file in found.files:
            with _one_line(file), file.open("rb") as stream:
                summary = make_reader(stream).get_summary()
                if summary is None:
                    break
                topics.update(dict.fromkeys(topics_of(summary).values()))
        else:
            return list(topics)
    with _one_line(found.path), Reader(found.path) as reader:
        return list(dict.fromkeys(_rosbags_topics(reader).values()))


def read_batches(path: Path, wanted: Wanted) -> Iterator[Batch]:
    """The messages of the topics for which `wanted` is true, in bulk and in file order. Raises RecordingError."""
    found = locate(path)
    if found.storage != ".mcap" or found.compressed:
        yield from gather(_rosbags_messages(found, wanted))
        return
    for file in found.files:
        with _one_line(file), file.open("rb") as stream:
            summary = make_reader(stream).get_summary()
            if summary is not None and is_indexed(summary):
                for batch in indexed_batches(stream, summary, wanted):
                    yield from plain_batch(batch)
            else:
                yield from gather(mcap_messages(file, wanted, ordered=False))


def iter_raw(path: Path, wanted: Wanted = lambda _: True) -> Iterator[RawMessage]:
    """The messages of the topics for which `wanted` is true, one by one in the order of their log times.

    Raises RecordingError.
    """
    found = locate(path)
    if found.storage == ".mcap" and not found.compressed:
        for file in found.files:
            yield from mcap_messages(file, wanted, ordered=True)
    else:
        yield from _rosbags_messages(found, wanted)


def mcap_messages(file: Path, wanted: Wanted, ordered: bool) -> Iterator[RawMessage]:
    """The messages of wanted topics of one MCAP file, one by one. ordered: by log time, else as they lie in the file.

    Raises RecordingError.
    """
    topics: dict[int, RawTopic | None] = {}
    with _one_line(file), file.open("rb") as stream:
        for schema, channel, message in make_reader(stream, validate_crcs=True).iter_messages(log_time_order=ordered):
            if channel.id not in topics:
                text = schema.data.decode(errors="replace") if schema and schema.encoding == "ros2msg" else ""
                topic = RawTopic(channel.topic, schema.name if schema else "", text)
                topics[channel.id] = topic if wanted(topic) else None
            if (known := topics[channel.id]) is not None:
                yield RawMessage(known, plain(message.data), message.log_time, message.publish_time)


def _rosbags_topics(reader: Reader) -> dict[int, RawTopic]:
    """Topics by connection id."""
    return {
        connection.id: RawTopic(
            connection.topic,
            connection.msgtype,
            connection.msgdef.data if connection.msgdef.format == MessageDefinitionFormat.MSG else "",
        )
        for connection in reader.connections
    }


def _rosbags_messages(found: RecordingFiles, wanted: Wanted) -> Iterator[RawMessage]:
    """SQLite3 and compressed recordings keep no publish times: the log time is used instead."""
    with _one_line(found.path), Reader(found.path) as reader:
        topics = _rosbags_topics(reader)
        chosen = [connection for connection in reader.connections if wanted(topics[connection.id])]
        if chosen:
            for connection, log_ns, raw in reader.messages(chosen):
                yield RawMessage(topics[connection.id], plain(bytes(raw)), log_ns, log_ns)
