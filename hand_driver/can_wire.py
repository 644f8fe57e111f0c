"""The CAN message layout, version 1: messages to samples and back, no I/O. hand_board.dbc is its specification.

Classic CAN, 11-bit identifiers, 8 bytes a message, little-endian. A sample is a header, the board time, as many
data messages as its channels fill, and a trailer with a CRC-32 over everything before it; set-points likewise.
The parts of a sample follow each other in this order, so one that is lost, repeated or out of place voids it.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hand_driver.board import ProtocolMismatch, Status
from hand_driver.wire import (
    LIFETIME_UNIT_S,
    PRESSURE_UNIT_PA,
    Payload,
    SamplePayload,
    SetPointPayload,
    pressure_codes,
)

VERSION = 1
SAMPLE_HEADER, SAMPLE_TIME, SAMPLE_DATA, SAMPLE_TRAILER = 0x100, 0x101, 0x110, 0x13F
ORDER_HEADER, ORDER_DATA, ORDER_TRAILER = 0x200, 0x210, 0x23F
TRAILERS = {SAMPLE_HEADER: SAMPLE_TRAILER, ORDER_HEADER: ORDER_TRAILER}
ID_OFFSETS = (0x00, 0x40, 0x80, 0xC0)
"""What may be added to every identifier, so that up to four hands share a bus."""
PER_MESSAGE = 4
MAX_CHANNELS = 40
MAX_VALVES = 16
LENGTH = 8
MOST_PARTS = 64
"""Longest sample of another version, in messages: its trailer is awaited no longer."""
_SAMPLE_HEADER = struct.Struct("<BBHI")  # version, channels, status, sequence
_TIME = struct.Struct("<Q")  # board time [us]
_ORDER_HEADER = struct.Struct("<BBHI")  # version, valves, lifetime [ms], sequence
_TRAILER = struct.Struct("<IHH")  # CRC-32, low bits of the sequence, supply [mV] (0 behind set-points)


@dataclass(frozen=True, slots=True)
class CanMessage:
    """One message: identifier and 8 bytes."""

    identifier: int
    data: bytes


def encode_sample(sample: SamplePayload) -> list[CanMessage]:
    """A sample as messages in the order to send. ValueError for more than MAX_CHANNELS channels."""
    count = len(sample.counts)
    if not 1 <= count <= MAX_CHANNELS:
        raise ValueError(f"{count} channels; CAN carries 1 to {MAX_CHANNELS}")
    header = _SAMPLE_HEADER.pack(VERSION, count, int(sample.status), sample.sequence)
    parts = [CanMessage(SAMPLE_HEADER, header), CanMessage(SAMPLE_TIME, _TIME.pack(sample.board_time_us))]
    parts += _data_messages(SAMPLE_DATA, sample.counts.astype("<u2").tobytes())
    supply_mv = round(sample.supply_voltage_v * 1e3)
    return [*parts, CanMessage(SAMPLE_TRAILER, _trailer(parts, sample.sequence, supply_mv))]


def encode_set_points(order: SetPointPayload) -> list[CanMessage]:
    """Set-points as messages in the order to send. ValueError for more than MAX_VALVES valves."""
    count = len(order.pressure_pa)
    if not 1 <= count <= MAX_VALVES:
        raise ValueError(f"{count} valves; CAN carries 1 to {MAX_VALVES}")
    lifetime_ms = min(max(round(order.lifetime_s / LIFETIME_UNIT_S), 0), 0xFFFF)
    parts = [CanMessage(ORDER_HEADER, _ORDER_HEADER.pack(VERSION, count, lifetime_ms, order.sequence))]
    parts += _data_messages(ORDER_DATA, pressure_codes(order.pressure_pa).astype("<u2").tobytes())
    return [*parts, CanMessage(ORDER_TRAILER, _trailer(parts, order.sequence, 0))]


def _data_messages(first: int, data: bytes) -> list[CanMessage]:
    padded = data + bytes(-len(data) % LENGTH)
    return [CanMessage(first + i, padded[LENGTH * i : LENGTH * (i + 1)]) for i in range(len(padded) // LENGTH)]


def _trailer(parts: Sequence[CanMessage], sequence: int, supply_mv: int) -> bytes:
    end = _TRAILER.pack(0, sequence & 0xFFFF, supply_mv)[4:]
    crc = zlib.crc32(b"".join(part.data for part in parts) + end)
    return struct.pack("<I", crc) + end


class CanAssembler:
    """Takes messages as they come and gives samples and set-points; broken ones are counted and skipped.

    The two directions are put together apart, so that set-points between the messages of a sample harm neither.
    """

    def __init__(self) -> None:
        """Begin between samples."""
        self._parts: dict[int, list[CanMessage]] = {SAMPLE_HEADER: [], ORDER_HEADER: []}
        self.corrupt = 0

    def feed(self, message: CanMessage) -> Payload | None:
        """What the message completes, if anything. Raises ProtocolMismatch for an intact sample of another version."""
        header = _header_of(message.identifier)
        if header is None:
            return None
        parts = self._parts[header]
        if message.identifier == header:
            self.corrupt += bool(parts)
            self._parts[header] = [message] if _may_begin(message) else []
            self.corrupt += not self._parts[header]
            return None
        if not parts:
            return None
        if len(message.data) != LENGTH or not _may_follow(parts, message.identifier):
            self._parts[header] = []
            self.corrupt += 1
            return None
        parts.append(message)
        if message.identifier != TRAILERS[header]:
            return None
        self._parts[header] = []
        payload = _parse(parts)
        self.corrupt += payload is None
        return payload


def _header_of(identifier: int) -> int | None:
    """The header of the direction an identifier belongs to; None where it is another device's."""
    return next((header for header, trailer in TRAILERS.items() if header <= identifier <= trailer), None)


def _may_begin(header: CanMessage) -> bool:
    """Whether a header is one; what the count of another version means is unknown."""
    if len(header.data) != LENGTH:
        return False
    most = MAX_CHANNELS if header.identifier == SAMPLE_HEADER else MAX_VALVES
    return header.data[0] != VERSION or 1 <= header.data[1] <= most


def _may_follow(parts: Sequence[CanMessage], identifier: int) -> bool:
    """Whether the identifier is that of the next part; of another version only first and last are known."""
    header, at = parts[0], len(parts) - 1
    if header.data[0] != VERSION:
        return len(parts) < MOST_PARTS
    messages = -(-header.data[1] // PER_MESSAGE)
    sample = header.identifier == SAMPLE_HEADER
    first = SAMPLE_DATA if sample else ORDER_DATA
    following = [SAMPLE_TIME] * sample + list(range(first, first + messages)) + [TRAILERS[header.identifier]]
    return identifier == following[at]


def _parse(messages: Sequence[CanMessage]) -> Payload | None:
    """What complete messages say; None where they are damaged. Raises ProtocolMismatch for an intact other version."""
    *parts, trailer = messages
    body = b"".join(part.data for part in parts)
    crc, sequence_low, supply_mv = _TRAILER.unpack(trailer.data)
    version, count, word, sequence = _SAMPLE_HEADER.unpack_from(body)
    sample = trailer.identifier == SAMPLE_TRAILER
    if zlib.crc32(body + trailer.data[4:]) != crc or not (sample or version == VERSION):
        return None
    if version != VERSION:
        raise ProtocolMismatch(f"the board speaks protocol version {version}, this driver speaks {VERSION}")
    if sequence & 0xFFFF != sequence_low:
        return None
    if sample:
        (time_us,) = _TIME.unpack_from(body, LENGTH)
        counts = np.frombuffer(body, "<u2", count, 2 * LENGTH)
        return SamplePayload(sequence, time_us, supply_mv * 1e-3, Status(word), counts)
    if word == 0:  # no lifetime: a set-point that holds for ever is refused
        return None
    codes = np.frombuffer(body, "<u2", count, LENGTH)
    return SetPointPayload(sequence, word * LIFETIME_UNIT_S, codes * PRESSURE_UNIT_PA)
