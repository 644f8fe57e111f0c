"""The CAN message layout, version 1: messages to samples and back, no I/O. hand_board.dbc specifies it.

Classic CAN, 11-bit identifiers, 8 bytes per message, little-endian. A sample consists of a header, the board time, the
data messages of its channels, and a trailer with a CRC-32 over all of them; set-points are sent in the same way. The
messages of a sample follow each other in this order: where one is lost, repeated or out of place, the sample is void.
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
SET_POINT_HEADER, SET_POINT_DATA, SET_POINT_TRAILER = 0x200, 0x210, 0x23F
TRAILERS = {SAMPLE_HEADER: SAMPLE_TRAILER, SET_POINT_HEADER: SET_POINT_TRAILER}
ID_OFFSETS = (0x00, 0x40, 0x80, 0xC0)
"""Offsets that may be added to every identifier, so that up to four hands can share a bus."""
PER_MESSAGE = 4
MAX_CHANNELS = 40
MAX_VALVES = 16
LENGTH = 8
MOST_PARTS = 64
"""Largest number of messages of a sample of another version; a longer one is given up."""
_SAMPLE_HEADER = struct.Struct("<BBHI")  # version, channels, status, sequence
_TIME = struct.Struct("<Q")  # board time [us]
_SET_POINT_HEADER = struct.Struct("<BBHI")  # version, valves, lifetime [ms], sequence
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


def encode_set_points(set_points: SetPointPayload) -> list[CanMessage]:
    """Set-points as messages in the order to send. ValueError for more than MAX_VALVES valves."""
    count = len(set_points.pressure_pa)
    if not 1 <= count <= MAX_VALVES:
        raise ValueError(f"{count} valves; CAN carries 1 to {MAX_VALVES}")
    lifetime_ms = min(max(round(set_points.lifetime_s / LIFETIME_UNIT_S), 0), 0xFFFF)
    parts = [CanMessage(SET_POINT_HEADER, _SET_POINT_HEADER.pack(VERSION, count, lifetime_ms, set_points.sequence))]
    parts += _data_messages(SET_POINT_DATA, pressure_codes(set_points.pressure_pa).astype("<u2").tobytes())
    return [*parts, CanMessage(SET_POINT_TRAILER, _trailer(parts, set_points.sequence, 0))]


def _data_messages(first: int, data: bytes) -> list[CanMessage]:
    padded = data + bytes(-len(data) % LENGTH)
    return [CanMessage(first + i, padded[LENGTH * i : LENGTH * (i + 1)]) for i in range(len(padded) // LENGTH)]


def _trailer(parts: Sequence[CanMessage], sequence: int, supply_mv: int) -> bytes:
    end = _TRAILER.pack(0, sequence & 0xFFFF, supply_mv)[4:]
    crc = zlib.crc32(b"".join(part.data for part in parts) + end)
    return struct.pack("<I", crc) + end


class CanAssembler:
    """Assembles messages to samples and set-points in order of arrival; damaged ones are counted and skipped.

    Each direction is assembled separately, so that messages of the two directions may alternate.
    """

    def __init__(self) -> None:
        """Begin between samples."""
        self._parts: dict[int, list[CanMessage]] = {SAMPLE_HEADER: [], SET_POINT_HEADER: []}
        self.corrupt = 0

    def feed(self, message: CanMessage) -> Payload | None:
        """The payload that this message completes, or None. ProtocolMismatch: an intact sample of another version."""
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
    """The header of the direction that an identifier belongs to; None for another device."""
    return next((header for header, trailer in TRAILERS.items() if header <= identifier <= trailer), None)


def _may_begin(header: CanMessage) -> bool:
    """Whether a header is valid; the meaning of the count is unknown for another version."""
    if len(header.data) != LENGTH:
        return False
    most = MAX_CHANNELS if header.identifier == SAMPLE_HEADER else MAX_VALVES
    return header.data[0] != VERSION or 1 <= header.data[1] <= most


def _may_follow(parts: Sequence[CanMessage], identifier: int) -> bool:
    """Whether the identifier is that of the next message; of another version only header and trailer are known."""
    header, at = parts[0], len(parts) - 1
    if header.data[0] != VERSION:
        return len(parts) < MOST_PARTS
    messages = -(-header.data[1] // PER_MESSAGE)
    sample = header.identifier == SAMPLE_HEADER
    first = SAMPLE_DATA if sample else SET_POINT_DATA
    following = [SAMPLE_TIME] * sample + list(range(first, first + messages)) + [TRAILERS[header.identifier]]
    return identifier == following[at]


def _parse(messages: Sequence[CanMessage]) -> Payload | None:
    """The payload of complete messages; None for damaged ones. ProtocolMismatch: another version, intact."""
    *parts, trailer = messages
    body = b"".join(part.data for part in parts)
    crc, sequence_low, supply_mv = _TRAILER.unpack(trailer.data)
    version, count, word, sequence = _SAMPLE_HEADER.unpack_from(body)
    sample = trailer.identifier == SAMPLE_TRAILER
    if zlib.crc32(body + trailer.data[4:]) != crc or not (sample or version == VERSION):
        return None
    if version != VERSION:
        raise ProtocolMismatch(f"the board uses protocol version {version}, this driver uses {VERSION}")
    if sequence & 0xFFFF != sequence_low:
        return None
    if sample:
        (time_us,) = _TIME.unpack_from(body, LENGTH)
        counts = np.frombuffer(body, "<u2", count, 2 * LENGTH)
        return SamplePayload(sequence, time_us, supply_mv * 1e-3, Status(word), counts)
    if word == 0:  # no lifetime: set-points without an end are refused
        return None
    codes = np.frombuffer(body, "<u2", count, LENGTH)
    return SetPointPayload(sequence, word * LIFETIME_UNIT_S, codes * PRESSURE_UNIT_PA)
