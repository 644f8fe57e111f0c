"""Reading an indexed MCAP file chunk by chunk.

The index lists where in a chunk the messages of a channel begin; their record headers are then read as one array.
The mcap library reads all other records and decompresses the chunks. Reading through the index takes about an eighth
of the time of the library's own message iterator (validation/bench/bench_loader.py).
Source of the format: MCAP specification, https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from io import BytesIO
from typing import BinaryIO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk, ChunkIndex
from mcap.stream_reader import get_chunk_data_stream
from mcap.summary import Summary
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from hand_recording.batches import BATCH_BYTES, Batch, RawTopic, Wanted, padded

_RECORD_HEAD = 9  # opcode and length before every record
_IN_RECORD = 22  # bytes of a message record between its length and its payload
_MESSAGE = np.dtype(
    {
        "names": ["opcode", "length", "channel", "log_ns", "publish_ns"],
        "formats": ["u1", "<u8", "<u2", "<u8", "<u8"],
        "offsets": [0, 1, 9, 15, 23],
        "itemsize": _RECORD_HEAD + _IN_RECORD,
    }
)
_INDEX = struct.Struct("<BQHI")  # opcode, length, channel, bytes of the following entries (log time, offset)


def is_indexed(summary: Summary | None) -> bool:
    """Whether every message of the file can be found through the summary."""
    if summary is None or summary.statistics is None or not summary.chunk_indexes:
        return False
    return all(index.message_index_offsets for index in summary.chunk_indexes)


def topics_of(summary: Summary) -> dict[int, RawTopic]:
    """The topics of a file by channel id."""
    topics = {}
    for channel in summary.channels.values():
        schema = summary.schemas.get(channel.schema_id)
        text = schema.data.decode(errors="replace") if schema and schema.encoding == "ros2msg" else ""
        topics[channel.id] = RawTopic(channel.topic, schema.name if schema else "", text)
    return topics


def indexed_batches(stream: BinaryIO, summary: Summary, wanted: Wanted) -> Iterator[Batch]:
    """The messages of the topics for which `wanted` is true, in file order.

    Raises McapError, and whatever the libraries raise on damaged bytes.
    """
    topics = {number: topic for number, topic in topics_of(summary).items() if wanted(topic)}
    found = dict.fromkeys(topics, 0)
    group = _Group()
    for index in summary.chunk_indexes:
        channels = topics.keys() & index.message_index_offsets.keys()
        if channels:
            group.add(stream, index, channels)
        if group.size > BATCH_BYTES:
            yield from group.batches(topics, found)
            group = _Group()
    yield from group.batches(topics, found)
    assert summary.statistics is not None
    for number, count in found.items():
        if count != summary.statistics.channel_message_counts.get(number, 0):
            raise McapError(f"the index lists {count} messages of {topics[number].name}, the statistics differ")


class _Group:
    """A few chunks, decompressed and concatenated."""

    def __init__(self) -> None:
        self.size = 0
        self._parts: list[bytes] = []
        self._records: dict[int, list[NDArray[np.int64]]] = {}

    def add(self, stream: BinaryIO, index: ChunkIndex, channels: set[int]) -> None:
        """Decompress one chunk and note where the records of these channels begin."""
        stream.seek(index.chunk_start_offset)
        block = stream.read(index.chunk_length + index.message_index_length)
        if len(block) < index.chunk_length + index.message_index_length:
            raise McapError(f"chunk at byte {index.chunk_start_offset} is cut off")
        body = BytesIO(block[_RECORD_HEAD : index.chunk_length])
        unpacked, size = get_chunk_data_stream(Chunk.read(ReadDataStream(body)), validate_crc=True)
        self._parts.append(unpacked.read(size))
        for number in channels:
            position = index.message_index_offsets[number] - index.chunk_start_offset
            offsets = _index_entries(block, position, number)
            if offsets.size and not 0 <= offsets.min() <= offsets.max() <= size - _MESSAGE.itemsize:
                raise McapError(f"index of the chunk at byte {index.chunk_start_offset} points outside it")
            self._records.setdefault(number, []).append(offsets + self.size)
        self.size += size

    def batches(self, topics: dict[int, RawTopic], found: dict[int, int]) -> Iterator[Batch]:
        """The noted messages; their numbers are added to `found`."""
        buffer = padded(self._parts)
        for number, parts in self._records.items():
            starts = np.concatenate(parts)
            heads = sliding_window_view(buffer, _MESSAGE.itemsize)[starts].view(_MESSAGE)[:, 0]
            sizes = heads["length"].astype(np.int64) - _IN_RECORD
            payloads = starts + _MESSAGE.itemsize
            right = (heads["opcode"] == Opcode.MESSAGE) & (heads["channel"] == number)
            if not (right & (sizes >= 0) & (payloads + sizes <= self.size)).all():
                raise McapError(f"the index of {topics[number].name} points at other bytes than its messages")
            found[number] += len(starts)
            times = heads["log_ns"].astype(np.int64), heads["publish_ns"].astype(np.int64)
            yield Batch(topics[number], buffer, payloads, sizes, *times)


def _index_entries(block: bytes, position: int, channel: int) -> NDArray[np.int64]:
    """Offsets in one message index record of `block`."""
    if not 0 <= position <= len(block) - _INDEX.size:
        raise McapError("an index record lies outside its chunk's")
    opcode, _, number, size = _INDEX.unpack_from(block, position)
    if opcode != Opcode.MESSAGE_INDEX or number != channel or position + _INDEX.size + size > len(block):
        raise McapError("an index record is not where the summary says")
    entries = np.frombuffer(block, "<u8", size // 8, position + _INDEX.size)
    return entries[1::2].astype(np.int64)
