"""The index of an MCAP file's chunks, read back from the file instead of kept in memory while it is written."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import ChunkIndex
from mcap.writer import MCAP0_MAGIC

_RECORD = struct.Struct("<BQ")  # opcode and length before every record
_CHUNK = struct.Struct("<QQQII")  # first and last time, uncompressed size, checksum, length of the compression's name
_LENGTH = struct.Struct("<Q")
_CHANNEL = struct.Struct("<H")


class ChunkIndexOnDisk:
    """Stands for the writer's list of chunk indexes: what is appended is dropped, and iterating reads the file.

    The list would grow by 700 bytes a chunk, 12 MB an hour; a chunk's head and its message indexes have it all.
    """

    def __init__(self, path: Path) -> None:
        """Of the file at path, which is being written."""
        self._path = path

    def append(self, index: ChunkIndex) -> None:
        """Drop it: the chunk is in the file."""

    def __iter__(self) -> Iterator[ChunkIndex]:
        """The index of every complete chunk in the file, one at a time."""
        index: ChunkIndex | None = None
        with self._path.open("rb") as stream:
            stream.seek(len(MCAP0_MAGIC))
            while len(head := stream.read(_RECORD.size)) == _RECORD.size:
                opcode, length = _RECORD.unpack(head)
                start = stream.tell() - _RECORD.size
                if opcode == Opcode.MESSAGE_INDEX and index is not None:
                    (channel,) = _CHANNEL.unpack(stream.read(_CHANNEL.size))
                    index.message_index_offsets[channel] = start
                    index.message_index_length += _RECORD.size + length
                elif index is not None:
                    yield index
                    index = None
                if opcode == Opcode.CHUNK:
                    index = _index(start, _RECORD.size + length, stream.read(min(length, 256)))
                if opcode == Opcode.DATA_END:
                    break
                stream.seek(start + _RECORD.size + length)
        if index is not None:
            yield index


def _index(start: int, length: int, head: bytes) -> ChunkIndex:
    first, last, size, _, named = _CHUNK.unpack_from(head)
    name = head[_CHUNK.size : _CHUNK.size + named].decode()
    (compressed,) = _LENGTH.unpack_from(head, _CHUNK.size + named)
    return ChunkIndex(
        message_start_time=first,
        message_end_time=last,
        chunk_start_offset=start,
        chunk_length=length,
        message_index_offsets={},
        message_index_length=0,
        compression=name,
        compressed_size=compressed,
        uncompressed_size=size,
    )
