"""The serial wire format, versions 1 and 2: bytes to payloads and back, no I/O. docs/protocol.md specifies it.

A packet is COBS(payload + CRC-32 of the payload, little-endian) followed by one zero byte. Payloads are
little-endian; the first two bytes are version and type.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from cobs import cobs
from numpy.typing import NDArray

from hand_driver.board import Counts, Echo, ProtocolMismatch, Status
from hand_model.arrays import Array

VERSIONS = (1, 2)
"""Versions of frames and set-points. Offers and answers always carry the first one, which every version reads."""
SAMPLE = 1
SET_POINTS = 2
OFFER = 3
ANSWER = 4
PRESSURE_UNIT_PA = 10.0
LIFETIME_UNIT_S = 1e-3
AGE_UNIT_S = 1e-3
NEVER = 0xFFFF
"""Age of an echo whose board has accepted no set-points."""
_HEAD = struct.Struct("<BB")
_SAMPLE = struct.Struct("<BBIQHHB")
_ECHO = struct.Struct("<BIBH")  # valves, sequence, accepted, age [ms]
_SET_POINTS = {1: struct.Struct("<BBIHB"), 2: struct.Struct("<BBIHIB")}
_OFFER = struct.Struct("<BBBBI")  # version, type, lowest and highest version (answer: chosen and highest), session
_CRC = struct.Struct("<I")
MAX_PACKET = 1280
"""Largest number of bytes kept while waiting for the delimiter; 255 channels and 255 valves need 1051."""


@dataclass(frozen=True, slots=True)
class SamplePayload:
    """One sample: sequence, board_time_us [us], supply_voltage_v [V], status, counts uint16 (channels,).

    echo: the set-points in force; version 1 does not carry it, and version 2 need not.
    """

    sequence: int
    board_time_us: int
    supply_voltage_v: float
    status: Status
    counts: Counts
    version: int = 1
    echo: Echo | None = None


@dataclass(frozen=True, slots=True)
class SetPointPayload:
    """One set of set-points: sequence, lifetime_s [s], pressure_pa (valves,) [Pa gauge].

    session: the one that host and board agreed on; None in version 1, which has none.
    """

    sequence: int
    lifetime_s: float
    pressure_pa: Array
    session: int | None = None


@dataclass(frozen=True, slots=True)
class OfferPayload:
    """The host offers its versions, lowest to highest, for a session: a random number of 32 bits."""

    lowest: int
    highest: int
    session: int


@dataclass(frozen=True, slots=True)
class AnswerPayload:
    """The board answers an offer: the version of this session, 0 for none in common, and its own highest version."""

    version: int
    highest: int
    session: int


Payload = SamplePayload | SetPointPayload | OfferPayload | AnswerPayload


def encode_sample(sample: SamplePayload) -> bytes:
    """A sample as one packet, delimiter included."""
    head = _SAMPLE.pack(
        sample.version,
        SAMPLE,
        sample.sequence,
        sample.board_time_us,
        int(sample.status),
        round(sample.supply_voltage_v * 1e3),
        len(sample.counts),
    )
    return _packet(head + sample.counts.astype("<u2").tobytes() + _echo_bytes(sample))


def _echo_bytes(sample: SamplePayload) -> bytes:
    echo = sample.echo
    if sample.version == 1:
        return b""
    if echo is None:
        return b"\x00"
    codes = pressure_codes(echo.pressure_pa)
    return _ECHO.pack(len(codes), echo.sequence, echo.accepted & 0xFF, age_code(echo.age_s)) + codes.tobytes()


def encode_set_points(set_points: SetPointPayload) -> bytes:
    """Set-points as one packet; pressures are rounded to 10 Pa and limited to 0 ... 655,350 Pa."""
    lifetime_ms = min(max(round(set_points.lifetime_s / LIFETIME_UNIT_S), 0), 0xFFFF)
    version = 1 if set_points.session is None else 2
    session = [] if set_points.session is None else [set_points.session]
    fields = (set_points.sequence, lifetime_ms, *session, len(set_points.pressure_pa))
    head = _SET_POINTS[version].pack(version, SET_POINTS, *fields)
    return _packet(head + pressure_codes(set_points.pressure_pa).tobytes())


def encode_offer(offer: OfferPayload) -> bytes:
    """An offer as one packet."""
    return _packet(_OFFER.pack(VERSIONS[0], OFFER, offer.lowest, offer.highest, offer.session))


def encode_answer(answer: AnswerPayload) -> bytes:
    """An answer as one packet."""
    return _packet(_OFFER.pack(VERSIONS[0], ANSWER, answer.version, answer.highest, answer.session))


def age_code(age_s: float) -> int:
    """An age [s] in ms, limited to 65,534; NEVER for NaN."""
    return NEVER if math.isnan(age_s) else min(max(round(age_s / AGE_UNIT_S), 0), NEVER - 1)


def age_of(code: int) -> float:
    """The age [s] of a code; NaN for NEVER."""
    return math.nan if code == NEVER else code * AGE_UNIT_S


def version_mismatch(version: int) -> ProtocolMismatch:
    """The error for a version that this driver does not use."""
    own = " and ".join(str(known) for known in reversed(VERSIONS))
    return ProtocolMismatch(f"the board uses protocol version {version}, this driver uses {own}")


def pressure_codes(pressure_pa: Array) -> NDArray[np.uint16]:
    """Pressures (n,) [Pa] in units of 10 Pa, (n,). ValueError for NaN or infinity, which must never reach a board."""
    if not np.isfinite(pressure_pa).all():
        raise ValueError("a set-point is not a finite number")
    return np.clip(np.rint(pressure_pa / PRESSURE_UNIT_PA), 0, 0xFFFF).astype("<u2")


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
        if version not in VERSIONS:
            raise version_mismatch(version)
        parse = _PARSERS.get(kind)
        parsed = None if parse is None else parse(payload)
        self.corrupt += parsed is None
        return parsed


def _parse_sample(payload: bytes) -> SamplePayload | None:
    if len(payload) < _SAMPLE.size:
        return None
    version, _, sequence, time_us, status, supply_mv, count = _SAMPLE.unpack_from(payload)
    end = _SAMPLE.size + 2 * count
    if len(payload) < end:
        return None
    counts = np.frombuffer(payload, "<u2", count, _SAMPLE.size)
    echo = None
    if version == 1:
        if len(payload) != end:
            return None
    elif payload[end:] != b"\x00":
        echo = _parse_echo(payload, end)
        if echo is None:
            return None
    return SamplePayload(sequence, time_us, supply_mv * 1e-3, Status(status), counts, version, echo)


def _parse_echo(payload: bytes, start: int) -> Echo | None:
    if len(payload) < start + _ECHO.size:
        return None
    valves, sequence, accepted, age_ms = _ECHO.unpack_from(payload, start)
    if not valves or len(payload) != start + _ECHO.size + 2 * valves:
        return None
    codes = np.frombuffer(payload, "<u2", valves, start + _ECHO.size)
    return Echo(sequence, age_of(age_ms), codes * PRESSURE_UNIT_PA, accepted)


def _parse_set_points(payload: bytes) -> SetPointPayload | None:
    form = _SET_POINTS[payload[0]]
    if len(payload) < form.size:
        return None
    _, _, sequence, lifetime_ms, *session, count = form.unpack_from(payload)
    if len(payload) != form.size + 2 * count or lifetime_ms == 0:
        return None
    codes = np.frombuffer(payload, "<u2", count, form.size)
    pressure_pa = codes * PRESSURE_UNIT_PA
    return SetPointPayload(sequence, lifetime_ms * LIFETIME_UNIT_S, pressure_pa, session[0] if session else None)


def _parse_offer(payload: bytes) -> OfferPayload | None:
    fields = _offer_fields(payload)
    return None if fields is None or not 1 <= fields[0] <= fields[1] else OfferPayload(*fields)


def _parse_answer(payload: bytes) -> AnswerPayload | None:
    fields = _offer_fields(payload)
    return None if fields is None or fields[0] > fields[1] else AnswerPayload(*fields)


def _offer_fields(payload: bytes) -> tuple[int, int, int] | None:
    if len(payload) != _OFFER.size or payload[0] != VERSIONS[0]:
        return None
    _, _, first, highest, session = _OFFER.unpack(payload)
    return first, highest, session


_PARSERS: dict[int, Callable[[bytes], Payload | None]] = {
    SAMPLE: _parse_sample,
    SET_POINTS: _parse_set_points,
    OFFER: _parse_offer,
    ANSWER: _parse_answer,
}
