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
PER_MESSAGE = 4
MAX_CHANNELS = 40
MAX_VALVES = 16
LENGTH = 8
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
    """Takes messages as they come and gives samples and set-points; broken ones are counted and skipped."""

    def __init__(self) -> None:
        """Begin between samples."""
        self._parts: list[CanMessage] = []
        self.corrupt = 0

    def feed(self, message: CanMessage) -> Payload | None:
        """What the message completes, if anything. Raises ProtocolMismatch for an intact sample of another version."""
        identifier = message.identifier
        if identifier in (SAMPLE_HEADER, ORDER_HEADER):
            self.corrupt += bool(self._parts)
            self._parts = [message] if len(message.data) == LENGTH else []
            return None
        if not _is_ours(identifier):
            return None
        if not self._parts or len(message.data) != LENGTH or identifier != self._expected():
            self.corrupt += bool(self._parts)
            self._parts = []
            return None
        self._parts.append(message)
        return self._finish() if identifier in (SAMPLE_TRAILER, ORDER_TRAILER) else None

    def _expected(self) -> int:
        """Identifier of the part that must come next."""
        header = self._parts[0]
        count = header.data[1]
        messages = -(-count // PER_MESSAGE)
        at = len(self._parts) - 1
        if header.identifier == ORDER_HEADER:
            return ORDER_DATA + at if at < messages else ORDER_TRAILER
        if at == 0:
            return SAMPLE_TIME
        return SAMPLE_DATA + at - 1 if at - 1 < messages else SAMPLE_TRAILER

    def _finish(self) -> Payload | None:
        *parts, trailer = self._parts
        self._parts = []
        body = b"".join(part.data for part in parts)
        crc, sequence_low, supply_mv = _TRAILER.unpack(trailer.data)
        version, count, word, sequence = _SAMPLE_HEADER.unpack(parts[0].data)
        if zlib.crc32(body + trailer.data[4:]) != crc or sequence & 0xFFFF != sequence_low:
            self.corrupt += 1
            return None
        if version != VERSION:
            raise ProtocolMismatch(f"the board speaks protocol version {version}, this driver speaks {VERSION}")
        if trailer.identifier == SAMPLE_TRAILER:
            time_us = _TIME.unpack(parts[1].data)[0]
            counts = np.frombuffer(body, "<u2", count, 2 * LENGTH)
            return SamplePayload(sequence, time_us, supply_mv * 1e-3, Status(word), counts)
        if word == 0:  # no lifetime: a set-point that holds for ever is refused
            self.corrupt += 1
            return None
        codes = np.frombuffer(body, "<u2", count, LENGTH)
        return SetPointPayload(sequence, word * LIFETIME_UNIT_S, codes * PRESSURE_UNIT_PA)


def _is_ours(identifier: int) -> bool:
    """Whether an identifier belongs to the hand; other devices may share the bus."""
    return SAMPLE_HEADER <= identifier <= SAMPLE_TRAILER or ORDER_HEADER <= identifier <= ORDER_TRAILER
