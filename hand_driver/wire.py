"""The serial wire format, version 1: bytes to payloads and back, no I/O. docs/protocol.md specifies it.

A packet is COBS(payload + CRC-32 of the payload, little-endian) followed by one zero byte. Payloads are
little-endian; the first two bytes are version and type.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

import numpy as np
from cobs import cobs
from numpy.typing import NDArray

from hand_driver.board import Counts, ProtocolMismatch, Status
from hand_model.arrays import Array

VERSION = 1
SAMPLE = 1
SET_POINTS = 2
PRESSURE_UNIT_PA = 10.0
LIFETIME_UNIT_S = 1e-3
_HEAD = struct.Struct("<BB")
_SAMPLE = struct.Struct("<BBIQHHB")
_SET_POINTS = struct.Struct("<BBIHB")
_CRC = struct.Struct("<I")
MAX_PACKET = 1024
"""Largest number of bytes kept while waiting for the delimiter; 255 channels need 560."""


@dataclass(frozen=True, slots=True)
class SamplePayload:
    """One sample: sequence, board_time_us [us], supply_voltage_v [V], status, counts uint16 (channels,)."""

    sequence: int
    board_time_us: int
    supply_voltage_v: float
    status: Status
    counts: Counts


@dataclass(frozen=True, slots=True)
class SetPointPayload:
    """One set of set-points: sequence, lifetime_s [s], pressure_pa (valves,) [Pa gauge]."""

    sequence: int
    lifetime_s: float
    pressure_pa: Array


Payload = SamplePayload | SetPointPayload


def encode_sample(sample: SamplePayload) -> bytes:
    """A sample as one packet, delimiter included."""
    head = _SAMPLE.pack(
        VERSION,
        SAMPLE,
        sample.sequence,
        sample.board_time_us,
        int(sample.status),
        round(sample.supply_voltage_v * 1e3),
        len(sample.counts),
    )
    return _packet(head + sample.counts.astype("<u2").tobytes())


def encode_set_points(set_points: SetPointPayload) -> bytes:
    """Set-points as one packet; pressures are rounded to 10 Pa and limited to 0 ... 655,350 Pa."""
    lifetime_ms = min(max(round(set_points.lifetime_s / LIFETIME_UNIT_S), 0), 0xFFFF)
    head = _SET_POINTS.pack(VERSION, SET_POINTS, set_points.sequence, lifetime_ms, len(set_points.pressure_pa))
    return _packet(head + pressure_codes(set_points.pressure_pa).astype("<u2").tobytes())


def pressure_codes(pressure_pa: Array) -> NDArray[np.uint16]:
    """Pressures (n,) [Pa] in units of 10 Pa, (n,). ValueError for NaN or infinity, which must never reach a board."""
    if not np.isfinite(pressure_pa).all():
        raise ValueError("a set-point is not a finite number")
    return np.clip(np.rint(pressure_pa / PRESSURE_UNIT_PA), 0, 0xFFFF).astype(np.uint16)


def _packet(payload: bytes) -> bytes:
    return bytes(cobs.encode(payload + _CRC.pack(zlib.crc32(payload)))) + b"\x00"


class PacketDecoder:
    """Decodes bytes in order of arrival to payloads; invalid packets are counted and skipped."""

    def __init__(self, joining: bool = False) -> None:
        """Begin between packets; with joining, possibly within one, whose remainder is not counted as corrupt."""
        self._joining = joining
        self._buffer = bytearray()
        self._overlong = False
        self.corrupt = 0

    def feed(self, data: bytes) -> list[Payload]:
        """All valid payloads that data completes.

        Raises ProtocolMismatch for an intact packet of another version; the bytes after it are kept.
        """
        self._buffer += data
        payloads = []
        while (end := self._buffer.find(0)) >= 0:
            packet = bytes(self._buffer[:end])
            del self._buffer[: end + 1]
            if self._overlong:  # the end of a packet that was already given up
                self._overlong = False
                continue
            payload = self._open(packet) if packet else None
            if self._joining:
                self._joining, self.corrupt = False, 0
            if payload is not None:
                payloads.append(payload)
        if len(self._buffer) > MAX_PACKET:
            self._buffer.clear()
            self.corrupt += not self._overlong
            self._overlong = True
        return payloads

    def _open(self, packet: bytes) -> Payload | None:
        try:
            content = bytes(cobs.decode(packet))
        except cobs.DecodeError:
            content = b""
        payload, crc = content[: -_CRC.size], content[-_CRC.size :]
        if len(payload) < _HEAD.size or zlib.crc32(payload) != _CRC.unpack(crc)[0]:
            self.corrupt += 1
            return None
        version, kind = _HEAD.unpack_from(payload)
        if version != VERSION:
            raise ProtocolMismatch(f"the board uses protocol version {version}, this driver uses {VERSION}")
        parsed = (
            _parse_sample(payload) if kind == SAMPLE else _parse_set_points(payload) if kind == SET_POINTS else None
        )
        self.corrupt += parsed is None
        return parsed


def _parse_sample(payload: bytes) -> SamplePayload | None:
    if len(payload) < _SAMPLE.size:
        return None
    _, _, sequence, time_us, status, supply_mv, count = _SAMPLE.unpack_from(payload)
    if len(payload) != _SAMPLE.size + 2 * count:
        return None
    counts = np.frombuffer(payload, "<u2", count, _SAMPLE.size)
    return SamplePayload(sequence, time_us, supply_mv * 1e-3, Status(status), counts)


def _parse_set_points(payload: bytes) -> SetPointPayload | None:
    if len(payload) < _SET_POINTS.size:
        return None
    _, _, sequence, lifetime_ms, count = _SET_POINTS.unpack_from(payload)
    if len(payload) != _SET_POINTS.size + 2 * count or lifetime_ms == 0:
        return None
    codes = np.frombuffer(payload, "<u2", count, _SET_POINTS.size)
    return SetPointPayload(sequence, lifetime_ms * LIFETIME_UNIT_S, codes * PRESSURE_UNIT_PA)
