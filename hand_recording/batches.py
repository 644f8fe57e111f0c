"""Messages of a recording as blocks of bytes and the positions of the messages in them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from zstandard import ZstdDecompressor, ZstdError, get_frame_parameters

BATCH_BYTES = 4 * 1024 * 1024
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""First bytes of a message that rosbag2 has compressed; a message that is not begins with 00."""
MOST_BYTES = 64 * 1024 * 1024
"""Largest message that is decompressed [bytes]."""
SPARE = 8  # zero bytes after every buffer, so that the last message can be read in words of 8


class RawTopic(NamedTuple):
    """A topic as the recording declares it; `definition` is empty where the storage has none."""

    name: str
    type: str
    definition: str


class RawMessage(NamedTuple):
    """One serialized message; times in ns."""

    topic: RawTopic
    raw: bytes
    log_ns: int
    publish_ns: int


@dataclass(frozen=True)
class Batch:
    """N messages of one topic.

    Message i is buffer[starts[i] : starts[i] + sizes[i]]; starts, sizes, log_ns, publish_ns: (N,), times in ns.
    """

    topic: RawTopic
    buffer: NDArray[np.uint8]
    starts: NDArray[np.int64]
    sizes: NDArray[np.int64]
    log_ns: NDArray[np.int64]
    publish_ns: NDArray[np.int64]

    def message(self, index: int) -> bytes:
        """The bytes of one message."""
        return self.buffer[self.starts[index] : self.starts[index] + self.sizes[index]].tobytes()


def plain(raw: bytes) -> bytes:
    """The message itself, decompressed where rosbag2 compressed it. Raises ZstdError where that fails."""
    if raw[:4] != ZSTD_MAGIC:
        return raw
    if get_frame_parameters(raw).content_size > MOST_BYTES:
        raise ZstdError(f"a message has more than {MOST_BYTES} bytes")
    return ZstdDecompressor().decompress(raw, max_output_size=MOST_BYTES)


def plain_batch(batch: Batch) -> Iterator[Batch]:
    """The batch itself, or its messages decompressed."""
    if not len(batch.sizes) or batch.message(0)[:4] != ZSTD_MAGIC:
        yield batch
        return
    times = zip(batch.log_ns.tolist(), batch.publish_ns.tolist(), strict=True)
    yield from gather(RawMessage(batch.topic, plain(batch.message(k)), *both) for k, both in enumerate(times))


Wanted = Callable[[RawTopic], bool]


def padded(parts: Iterable[bytes]) -> NDArray[np.uint8]:
    """The concatenated parts, followed by the spare bytes, (bytes,)."""
    return np.frombuffer(b"".join([*parts, bytes(SPARE)]), np.uint8)


def gather(messages: Iterable[RawMessage]) -> Iterator[Batch]:
    """Batches of messages that arrive one by one, of at most about BATCH_BYTES."""
    waiting: dict[RawTopic, list[RawMessage]] = {}
    size = 0
    for message in messages:
        waiting.setdefault(message.topic, []).append(message)
        size += len(message.raw)
        if size > BATCH_BYTES:
            yield from map(_batch, waiting.values())
            waiting, size = {}, 0
    yield from map(_batch, waiting.values())


def _batch(messages: list[RawMessage]) -> Batch:
    sizes = np.array([len(message.raw) for message in messages], np.int64)
    return Batch(
        messages[0].topic,
        padded(message.raw for message in messages),
        np.cumsum(sizes) - sizes,
        sizes,
        np.array([message.log_ns for message in messages], np.int64),
        np.array([message.publish_ns for message in messages], np.int64),
    )
