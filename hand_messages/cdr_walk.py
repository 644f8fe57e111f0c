"""The CDR wire format: laying out a message of a type, and reading the shape of a received one.

The format is little-endian XCDR1 as the ROS 2 middlewares write it (OMG DDS-XTypes 1.3, 7.4.1): a 4-byte encapsulation
header, then fields aligned to their own size relative to byte 4. A string is a uint32 length including the closing NUL,
the bytes and the NUL. An empty list aligns nothing after its length. Bytes skipped by alignment are undefined.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from hand_messages.layouts import MessageSpec

ENCAPSULATION = b"\x00\x01"  # plain CDR, little-endian; the two option bytes after it are not used
HEADER_SIZE = 4
LEAST_STRING = 4  # bytes: the length alone
TIME = "T"  # code of the structure of int32 sec and uint32 nanosec

_CODES: dict[str, str] = {
    "bool": "?",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}


class LayoutError(ValueError):
    """These bytes or values do not fit the layout; the message names the field and the problem."""


class Slot(NamedTuple):
    """The place of a value: key, offset from the message's first byte, type code, list length (None: one value)."""

    key: str
    offset: int
    code: str
    length: int | None

    @property
    def dtype(self) -> np.dtype[Any]:
        """NumPy type of one element on the wire."""
        return np.dtype([("sec", "<i4"), ("nanosec", "<u4")] if self.code == TIME else "<" + self.code)


class Shape(NamedTuple):
    """What stays the same in all messages: frame, entries of each string list, length of each number list."""

    frame_id: str
    names: Mapping[str, tuple[str, ...]]
    lengths: Mapping[str, int]


def element_code(spec: MessageSpec, kind: str) -> str:
    """Struct code of a number type. Raises LayoutError for a type that fixed layouts do not support."""
    if kind not in _CODES:
        raise LayoutError(f"{spec.type}: field type {kind} has no fixed layout")
    return _CODES[kind]


class Plan:
    """A message being laid out: its bytes with all values zero, the constant segments, the slots."""

    def __init__(self) -> None:
        self.template = bytearray(ENCAPSULATION + b"\x00\x00")
        self.segments: list[tuple[int, int]] = [(0, 2)]
        self.slots: list[Slot] = []

    def _align(self, size: int) -> None:
        self.template += bytes(-(len(self.template) - HEADER_SIZE) % size)

    def _constant(self, data: bytes) -> None:
        start, stop = len(self.template), len(self.template) + len(data)
        if self.segments[-1][1] == start:
            start = self.segments.pop()[0]
        self.segments.append((start, stop))
        self.template += data

    def length(self, value: int) -> None:
        """Append the constant length of a list or a string."""
        self._align(4)
        self._constant(struct.pack("<I", value))

    def string(self, text: str) -> None:
        """Append a constant string."""
        data = text.encode() + b"\x00"
        self.length(len(data))
        self._constant(data)

    def slot(self, key: str, code: str, count: int | None = None) -> None:
        """Append a single value, or the elements of a list."""
        size = 4 if code == TIME else struct.calcsize("<" + code)
        if count != 0:
            self._align(size)
        self.slots.append(Slot(key, len(self.template), code, count))
        self.template += bytes((8 if code == TIME else size) * (1 if count is None else count))


def lay_out(spec: MessageSpec, shape: Shape) -> Plan:
    """Lay out a message of this type and shape."""
    plan = Plan()
    for field, kind in spec.fields:
        if kind == "header":
            plan.slot("stamp_ns", TIME)
            plan.string(shape.frame_id)
        elif kind in ("time", "duration"):
            plan.slot(f"{field}_ns", TIME)
        elif kind == "string[]":
            plan.length(len(shape.names[field]))
            for name in shape.names[field]:
                plan.string(name)
        elif kind.endswith("[]"):
            plan.length(shape.lengths[field])
            plan.slot(field, element_code(spec, kind[:-2]), shape.lengths[field])
        else:
            plan.slot(field, element_code(spec, kind))
    return plan


class Cursor:
    """Reads lengths and strings of one message; each step is checked against the end of the message."""

    def __init__(self, kind: str, raw: bytes) -> None:
        """Begin after the encapsulation header. kind: type of the message, for errors.  Raises LayoutError."""
        if raw[:2] != ENCAPSULATION:
            raise LayoutError(f"{kind}: not little-endian CDR")
        self.kind, self.raw, self.position = kind, raw, HEADER_SIZE

    def skip(self, size: int, count: int = 1) -> int:
        """Skip `count` aligned elements; returns their start. Raises LayoutError where the bytes end before."""
        start = self.position
        if count:
            start += -(start - HEADER_SIZE) % size
        if start + size * count > len(self.raw):
            raise LayoutError(f"{self.kind}: cut off at byte {len(self.raw)}")
        self.position = start + size * count
        return start

    def length(self) -> int:
        """Length of a list or a string."""
        return int(struct.unpack_from("<I", self.raw, self.skip(4))[0])

    def entries(self, field: str, least_size: int, most: int | None) -> int:
        """Length of a list, before anything is made of its entries of at least least_size bytes each.

        Raises LayoutError for more than `most` entries, or more than the bytes can hold.
        """
        count = self.length()
        if most is not None and count > most:
            raise LayoutError(f"{self.kind}: {field} has {count} entries; at most {most} are allowed")
        if count * least_size > len(self.raw) - self.position:
            raise LayoutError(f"{self.kind}: cut off at byte {len(self.raw)}")
        return count

    def strings(self, field: str, most: int | None) -> tuple[str, ...]:
        """A list of strings; raises LayoutError where it has more than `most` entries."""
        return tuple(self.string() for _ in range(self.entries(field, LEAST_STRING, most)))

    def string(self) -> str:
        """A string without its closing NUL. Raises LayoutError where it is not UTF-8."""
        size = self.length()
        start = self.skip(1, size)
        try:
            return self.raw[start : start + max(size - 1, 0)].decode()
        except UnicodeDecodeError:
            raise LayoutError(f"{self.kind}: string at byte {start} is not UTF-8") from None


def read_shape(spec: MessageSpec, raw: bytes, most_names: int | None = None) -> Shape:
    """Frame, names and list lengths of one message.

    most_names: largest number of entries of a list of names; None: any.  Raises LayoutError where the bytes are not of
    the type or a list is too long.
    """
    cursor, frame_id = Cursor(spec.type, raw), ""
    names: dict[str, tuple[str, ...]] = {}
    lengths: dict[str, int] = {}
    for field, kind in spec.fields:
        if kind == "header":
            cursor.skip(4, 2)
            frame_id = cursor.string()
        elif kind in ("time", "duration"):
            cursor.skip(4, 2)
        elif kind == "string[]":
            names[field] = cursor.strings(field, most_names)
        elif kind.endswith("[]"):
            lengths[field] = cursor.length()
            cursor.skip(struct.calcsize("<" + element_code(spec, kind[:-2])), lengths[field])
        else:
            cursor.skip(struct.calcsize("<" + element_code(spec, kind)))
    return Shape(frame_id, names, lengths)


def complete_shape(
    spec: MessageSpec, frame_id: str, names: Mapping[str, tuple[str, ...]], lengths: Mapping[str, int]
) -> Shape:
    """A shape with every list of the message: a number list not named has as many elements as names.

    Raises LayoutError for a field that the message does not have and for an unknown length.
    """
    texts = [field for field, kind in spec.fields if kind == "string[]"]
    numbers = [field for field, kind in spec.fields if kind.endswith("[]") and kind != "string[]"]
    if unknown := sorted(set(names) - set(texts)) + sorted(set(lengths) - set(numbers)):
        raise LayoutError(f"{spec.type}: has no such list: {', '.join(unknown)}")
    full = {field: tuple(names.get(field, ())) for field in texts}
    if len(texts) != 1 and (missing := sorted(set(numbers) - set(lengths))):
        raise LayoutError(f"{spec.type}: length of {', '.join(missing)} not given")
    common = len(full[texts[0]]) if texts else 0
    return Shape(frame_id, full, {field: lengths.get(field, common) for field in numbers})
