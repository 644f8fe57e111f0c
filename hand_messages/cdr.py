"""Fixed-layout CDR: messages whose names and list lengths stay the same, as byte records.

The messages of a hand repeat the same names and lengths in every sample; only numbers change. A Layout holds the
positions of the numbers, so that a message is encoded or decoded by a few copies, and a whole recording by NumPy. That
takes a fifth of rclpy's time to encode and less than a tenth to decode (validation/bench/bench_codec.py).

Keys of values: a `header` field gives `stamp_ns`, a time or duration field `X` gives `X_ns` (int, ns); every other
field keeps its name. Message types are in layouts.py, the wire format in cdr_walk.py.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hand_messages.cdr_walk import HEADER_SIZE, TIME, LayoutError, Slot, complete_shape, lay_out, read_shape
from hand_messages.layouts import MessageSpec

__all__ = ["Layout", "LayoutError", "RowDecoder"]

NS = 1_000_000_000
# Bytes that may follow the last field: padding to 4, and more in what rclpy's serialize_message returns for messages
# with empty lists. On the wire there are at most 3.
SPARE_BYTES = 64

Columns = dict[str, NDArray[Any]]


class Layout:
    """A message type with fixed frame, names and list lengths.

    It encodes and decodes through buffers of its own and is therefore not thread-safe.
    """

    def __init__(
        self,
        spec: MessageSpec,
        frame_id: str = "",
        names: Mapping[str, Sequence[str]] | Sequence[str] = (),
        lengths: Mapping[str, int] | None = None,
    ) -> None:
        """Lay out `spec`.

        names: entries of each string list by field, or of the field `name`.
        lengths: number of elements of each number list by field; a list that is not given has as many elements as the
        message has names.  Raises LayoutError where a field is not part of the message or a length is missing.
        """
        if not isinstance(names, Mapping):
            names = {"name": names} if names else {}
        by_field = {field: tuple(entries) for field, entries in names.items()}
        self.spec = spec
        self.shape = complete_shape(spec, frame_id, by_field, lengths or {})
        plan = lay_out(spec, self.shape)
        self.slots = tuple(plan.slots)
        self.template = bytes(plan.template)
        self.segments = tuple(plan.segments)
        self.size = len(self.template)
        self.dtype = record_type(self.slots, self.size)
        self._keys = frozenset(slot.key for slot in self.slots if slot.length != 0)
        self._constants = _constant_struct(self.segments)
        self._expected = self._constants.unpack_from(self.template)
        self._scalars = tuple(
            (s.key, struct.Struct("<iI" if s.code == TIME else "<" + s.code), s.offset, s.code == TIME)
            for s in self.slots
            if s.length is None
        )
        self._flags = tuple(s.key for s in self.slots if s.code == "?" and s.length is not None)
        self._out, views = self._buffer()
        self._out_views = tuple((key, view) for key, view in views.items() if view.size)
        self._in, self._in_views = self._buffer()

    @classmethod
    def like(cls, spec: MessageSpec, raw: bytes, most_names: int | None = None) -> Layout:
        """The layout of a received message of type `spec`, with at most most_names entries in a list of names.

        Raises LayoutError where its bytes are not of that type or a list is longer.
        """
        shape = read_shape(spec, raw, most_names)
        layout = cls(spec, shape.frame_id, shape.names, shape.lengths)
        if not layout.matches(raw):
            raise LayoutError(f"{spec.type}: {len(raw)} bytes do not have the layout of this type")
        return layout

    @property
    def names(self) -> tuple[str, ...]:
        """Entries of the message's field `name`; empty where it has no such field."""
        return self.shape.names.get("name", ())

    def encode(self, stamp_ns: int | None = None, **values: Any) -> bytes:
        """Encode one message. Every value must be given, except empty lists; lists must have their length.

        Raises LayoutError for missing or unknown values, lists of another length, and numbers out of range.
        """
        if stamp_ns is not None:
            values["stamp_ns"] = stamp_ns
        if values.keys() != self._keys:
            raise LayoutError(f"{self.spec.type}: got {sorted(values)}, needs {sorted(self._keys)}")
        for key, view in self._out_views:
            value = values[key]
            if len(value) != view.size:
                raise LayoutError(f"{self.spec.type}.{key}: {len(value)} values, needs {view.size}")
            view[:] = value
        for key, form, offset, is_time in self._scalars:
            parts = divmod(values[key], NS) if is_time else (values[key],)
            try:
                form.pack_into(self._out, offset, *parts)
            except struct.error as error:
                raise LayoutError(f"{self.spec.type}.{key}: cannot hold {values[key]!r}: {error}") from None
        return self._out.tobytes()

    def matches(self, raw: bytes) -> bool:
        """Whether `raw` has this layout: the same frame, names and lengths."""
        spare = len(raw) - self.size
        return 0 <= spare <= SPARE_BYTES and self._constants.unpack_from(raw) == self._expected

    def decode(self, raw: bytes) -> dict[str, Any]:
        """Values of one message by key: numbers, and views of an internal buffer for lists.

        The next call overwrites the views: copy what must be kept.
        Raises LayoutError where the message has another layout.
        """
        if not self.matches(raw):
            raise LayoutError(f"{self.spec.type}: frame, names or lengths are not those of the layout")
        self._in[:] = raw[: self.size]
        values: dict[str, Any] = self._in_views.copy()
        for key, form, offset, is_time in self._scalars:
            read = form.unpack_from(raw, offset)
            values[key] = read[0] * NS + read[1] if is_time else read[0]
        for key in self._flags:
            values[key] = values[key].view(np.uint8) != 0
        return values

    def _buffer(self) -> tuple[memoryview, Columns]:
        """A record whose byte 4 is aligned to 8 bytes in memory, and a view of each list in it."""
        spare = np.zeros(self.size + 8, np.uint8)
        start = -(spare.ctypes.data + HEADER_SIZE) % 8
        record = spare[start : start + self.size]
        record[:] = np.frombuffer(self.template, np.uint8)
        fields = record.view(self.dtype)[0]
        return record.data, {slot.key: fields[slot.key] for slot in self.slots if slot.length is not None}


class RowDecoder:
    """Decodes many messages of one layout at once, given as rows of contiguous bytes (N, row_size), uint8.

    Each row begins with the first byte of a message. row_size is the layout's size rounded up to a multiple of 8; the
    bytes after the message are ignored.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.row_size = -(-layout.size // 8) * 8
        self._dtype = record_type(layout.slots, self.row_size)
        mask = np.zeros(self.row_size, np.uint8)
        for start, stop in layout.segments:
            mask[start:stop] = 0xFF
        used = np.flatnonzero(mask.view(np.uint64))
        self._span = slice(int(used[0]), int(used[-1]) + 1)
        self._mask = mask.view(np.uint64)[self._span]
        template = np.frombuffer(layout.template.ljust(self.row_size, b"\x00"), np.uint64)
        self._constants = template[self._span] & self._mask

    def fits(self, sizes: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which messages of these sizes (N,) [bytes] can have the layout at all, (N,)."""
        spare = sizes - self.layout.size
        return (spare >= 0) & (spare <= SPARE_BYTES)

    def matching(self, rows: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Which rows have the layout, as bool (N,)."""
        differing = (rows.view(np.uint64)[:, self._span] ^ self._constants) & self._mask
        good: NDArray[np.bool_] = np.bitwise_or.reduce(differing, axis=1) == 0
        return good

    def extract(self, rows: NDArray[np.uint8]) -> Columns:
        """Values by key of rows that match: times int64 ns (N,), numbers (N,), lists (N, length)."""
        records = rows.view(self._dtype)[:, 0]
        return {slot.key: _column(records[slot.key]) for slot in self.layout.slots}


def record_type(slots: Sequence[Slot], size: int) -> np.dtype[Any]:
    """The whole message as a structured type: a field for each slot; constants and padding are the gaps."""
    formats = [slot.dtype if slot.length is None else (slot.dtype, (slot.length,)) for slot in slots]
    keys, offsets = [slot.key for slot in slots], [slot.offset for slot in slots]
    return np.dtype({"names": keys, "formats": formats, "offsets": offsets, "itemsize": size})


def _constant_struct(segments: Sequence[tuple[int, int]]) -> struct.Struct:
    """A struct that unpacks the constant segments of a message and skips everything else."""
    form, position = "<", 0
    for start, stop in segments:
        form += f"{start - position}x{stop - start}s"
        position = stop
    return struct.Struct(form)


def _column(field: NDArray[Any]) -> NDArray[Any]:
    """A field of a record array as a contiguous array: times in ns, flags as bool."""
    if field.dtype.names:
        times: NDArray[np.int64] = field["sec"].astype(np.int64) * NS + field["nanosec"]
        return times
    if field.dtype == np.bool_:
        flags: NDArray[np.bool_] = field.view(np.uint8) != 0
        return flags
    return np.ascontiguousarray(field)
