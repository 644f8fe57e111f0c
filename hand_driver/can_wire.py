"""The CAN message layout, versions 1 and 2: messages to samples and back, no I/O. hand_board.dbc specifies it.

Classic CAN, 11-bit identifiers, 8 bytes per message, little-endian. A sample consists of a header, the board time, the
data messages of its channels, in version 2 the echo of the set-points in force, and a trailer with a CRC-32 over all of
them; set-points are sent in the same way. The messages of a sample follow each other in this order: where one is lost,
repeated or out of place, the sample is void. Offers and answers are single messages with a check of their own.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hand_driver.board import Echo, Status
from hand_driver.wire import (
    LIFETIME_UNIT_S,
    PRESSURE_UNIT_PA,
    VERSIONS,
    AnswerPayload,
    OfferPayload,
    Payload,
    SamplePayload,
    SetPointPayload,
    age_code,
    age_of,
    pressure_codes,
    version_mismatch,
)

SAMPLE_HEADER, SAMPLE_TIME, SAMPLE_DATA, SAMPLE_TRAILER = 0x100, 0x101, 0x110, 0x13F
SAMPLE_ECHO, SAMPLE_ECHO_DATA = 0x120, 0x121
SET_POINT_HEADER, SET_POINT_SESSION, SET_POINT_DATA, SET_POINT_TRAILER = 0x200, 0x201, 0x210, 0x23F
ANSWER, OFFER = 0x13E, 0x23E
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
_ECHO = struct.Struct("<BBHI")  # valves, accepted, age [ms], sequence
_SESSION = struct.Struct("<II")  # session, 0
_OFFER = struct.Struct("<BBHI")  # lowest and highest version (answer: chosen and highest), check, session
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
    header = _SAMPLE_HEADER.pack(sample.version, count, int(sample.status), sample.sequence)
    parts = [CanMessage(SAMPLE_HEADER, header), CanMessage(SAMPLE_TIME, _TIME.pack(sample.board_time_us))]
    parts += _data_messages(SAMPLE_DATA, sample.counts.astype("<u2").tobytes())
    if sample.version > 1 and sample.echo is not None:
        parts += _echo_messages(sample.echo)
    supply_mv = round(sample.supply_voltage_v * 1e3)
    return [*parts, CanMessage(SAMPLE_TRAILER, _trailer(parts, sample.sequence, supply_mv))]


def _echo_messages(echo: Echo) -> list[CanMessage]:
    codes = pressure_codes(echo.pressure_pa)
    head = _ECHO.pack(_valve_count(codes), echo.accepted & 0xFF, age_code(echo.age_s), echo.sequence)
    return [CanMessage(SAMPLE_ECHO, head), *_data_messages(SAMPLE_ECHO_DATA, codes.tobytes())]


def encode_set_points(set_points: SetPointPayload) -> list[CanMessage]:
    """Set-points as messages in the order to send. ValueError for more than MAX_VALVES valves."""
    codes = pressure_codes(set_points.pressure_pa)
    lifetime_ms = min(max(round(set_points.lifetime_s / LIFETIME_UNIT_S), 0), 0xFFFF)
    version = 1 if set_points.session is None else 2
    header = _SET_POINT_HEADER.pack(version, _valve_count(codes), lifetime_ms, set_points.sequence)
    parts = [CanMessage(SET_POINT_HEADER, header)]
    if set_points.session is not None:
        parts.append(CanMessage(SET_POINT_SESSION, _SESSION.pack(set_points.session, 0)))
    parts += _data_messages(SET_POINT_DATA, codes.tobytes())
    return [*parts, CanMessage(SET_POINT_TRAILER, _trailer(parts, set_points.sequence, 0))]


def encode_offer(offer: OfferPayload) -> CanMessage:
    """An offer as one message."""
    return CanMessage(OFFER, _offer_data(offer.lowest, offer.highest, offer.session))


def encode_answer(answer: AnswerPayload) -> CanMessage:
    """An answer as one message."""
    return CanMessage(ANSWER, _offer_data(answer.version, answer.highest, answer.session))


def _offer_data(first: int, highest: int, session: int) -> bytes:
    check = zlib.crc32(struct.pack("<BBI", first, highest, session)) & 0xFFFF
    return _OFFER.pack(first, highest, check, session)


def _valve_count(codes: NDArray[np.uint16]) -> int:
    if not 1 <= len(codes) <= MAX_VALVES:
        raise ValueError(f"{len(codes)} valves; CAN carries 1 to {MAX_VALVES}")
    return len(codes)


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
        if message.identifier in (OFFER, ANSWER):
            return self._take_offer(message)
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
        if len(message.data) != LENGTH or not _may_follow(parts, message):
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

    def _take_offer(self, message: CanMessage) -> Payload | None:
        payload = _parse_offer(message)
        self.corrupt += payload is None
        return payload


def _parse_offer(message: CanMessage) -> OfferPayload | AnswerPayload | None:
    if len(message.data) != LENGTH:
        return None
    first, highest, _, session = _OFFER.unpack(message.data)
    if message.data != _offer_data(first, highest, session) or first > highest:
        return None
    if message.identifier == ANSWER:
        return AnswerPayload(first, highest, session)
    return OfferPayload(first, highest, session) if first else None


def _header_of(identifier: int) -> int | None:
    """The header of the direction that an identifier belongs to; None for another device."""
    return next((header for header, trailer in TRAILERS.items() if header <= identifier <= trailer), None)


def _may_begin(header: CanMessage) -> bool:
    """Whether a header is valid; the meaning of the count is unknown for another version."""
    if len(header.data) != LENGTH:
        return False
    most = MAX_CHANNELS if header.identifier == SAMPLE_HEADER else MAX_VALVES
    return header.data[0] not in VERSIONS or 1 <= header.data[1] <= most


def _may_follow(parts: Sequence[CanMessage], message: CanMessage) -> bool:
    """Whether a message may be the next one; of another version only header and trailer are known."""
    header, at = parts[0], len(parts) - 1
    version, count = header.data[0], header.data[1]
    if version not in VERSIONS:
        return len(parts) < MOST_PARTS
    if header.identifier == SET_POINT_HEADER:
        expected = [SET_POINT_SESSION] * (version > 1) + _data_identifiers(SET_POINT_DATA, count)
        return message.identifier == ([*expected, SET_POINT_TRAILER])[at]
    expected = [SAMPLE_TIME, *_data_identifiers(SAMPLE_DATA, count)]
    if at < len(expected):
        return message.identifier == expected[at]
    if at == len(expected):
        echo = version > 1 and message.identifier == SAMPLE_ECHO and 1 <= message.data[0] <= MAX_VALVES
        return echo or message.identifier == SAMPLE_TRAILER
    valves = parts[len(expected) + 1].data[0]
    echoed = [*_data_identifiers(SAMPLE_ECHO_DATA, valves), SAMPLE_TRAILER]
    return message.identifier == echoed[at - len(expected) - 1]


def _data_identifiers(first: int, values: int) -> list[int]:
    return list(range(first, first - (-values // PER_MESSAGE)))


def _parse(messages: Sequence[CanMessage]) -> Payload | None:
    """The payload of complete messages; None for damaged ones. ProtocolMismatch: another version, intact."""
    *parts, trailer = messages
    body = b"".join(part.data for part in parts)
    crc, sequence_low, supply_mv = _TRAILER.unpack(trailer.data)
    version, count, word, sequence = _SAMPLE_HEADER.unpack_from(body)
    sample = trailer.identifier == SAMPLE_TRAILER
    if zlib.crc32(body + trailer.data[4:]) != crc or not (sample or version in VERSIONS):
        return None
    if version not in VERSIONS:
        raise version_mismatch(version)
    if sequence & 0xFFFF != sequence_low:
        return None
    if sample:
        (time_us,) = _TIME.unpack_from(body, LENGTH)
        counts = np.frombuffer(body, "<u2", count, 2 * LENGTH)
        echo = _parse_echo(body, LENGTH * (2 + len(_data_identifiers(SAMPLE_DATA, count))))
        return SamplePayload(sequence, time_us, supply_mv * 1e-3, Status(word), counts, version, echo)
    if word == 0:  # no lifetime: set-points without an end are refused
        return None
    session = _SESSION.unpack_from(body, LENGTH)[0] if version > 1 else None
    codes = np.frombuffer(body, "<u2", count, LENGTH if session is None else 2 * LENGTH)
    return SetPointPayload(sequence, word * LIFETIME_UNIT_S, codes * PRESSURE_UNIT_PA, session)


def _parse_echo(body: bytes, start: int) -> Echo | None:
    if len(body) == start:
        return None
    valves, accepted, age_ms, sequence = _ECHO.unpack_from(body, start)
    codes = np.frombuffer(body, "<u2", valves, start + LENGTH)
    return Echo(sequence, age_of(age_ms), codes * PRESSURE_UNIT_PA, accepted)
