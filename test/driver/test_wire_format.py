"""The serial wire format byte by byte, and every way in which a packet can be invalid."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
from cobs import cobs

from hand_driver import wire
from hand_driver.board import ProtocolMismatch, Status
from hand_driver.wire import (
    PacketDecoder,
    SamplePayload,
    SetPointPayload,
    encode_sample,
    encode_set_points,
    pressure_codes,
)

COUNTS = np.array([1, 258, 65535], np.uint16)
SAMPLE = SamplePayload(0x01020304, 0x1122334455667788, 4.987, Status.SUPPLY_LOW, COUNTS)
SAMPLE_BYTES = (
    bytes([1, 1]) + bytes([4, 3, 2, 1]) + bytes([0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11])
    + bytes([2, 0]) + struct.pack("<H", 4987) + bytes([3]) + bytes([1, 0, 2, 1, 255, 255])
)  # fmt: skip
SET_POINTS = SetPointPayload(0x01020304, 0.1, np.array([0.0, 1e5, 655350.0]))
SET_POINT_BYTES = bytes([1, 2, 4, 3, 2, 1, 100, 0, 3, 0, 0, 0x10, 0x27, 255, 255])


def test_the_bits_of_the_status() -> None:
    """Fails when a status bit that firmware relies on changes."""
    bits = (Status.VENTED, Status.SUPPLY_LOW, Status.OVER_PRESSURE, Status.ADC_FAULT)
    assert [int(bit) for bit in bits] == [1, 2, 4, 8]


def packet(payload: bytes) -> bytes:
    return bytes(cobs.encode(payload + struct.pack("<I", zlib.crc32(payload)))) + b"\0"


def test_a_sample_has_these_bytes() -> None:
    """Fails when a field of the sample changes its place, width, order or unit."""
    assert encode_sample(SAMPLE) == packet(SAMPLE_BYTES)
    (payload,) = PacketDecoder().feed(packet(SAMPLE_BYTES))
    assert isinstance(payload, SamplePayload)
    assert (payload.sequence, payload.board_time_us) == (SAMPLE.sequence, SAMPLE.board_time_us)
    assert payload.supply_voltage_v == pytest.approx(4.987) and payload.status == Status.SUPPLY_LOW
    assert payload.counts.tolist() == COUNTS.tolist()


def test_set_points_have_these_bytes() -> None:
    """Fails when a field of the set-points changes its place, width, order or unit."""
    assert encode_set_points(SET_POINTS) == packet(SET_POINT_BYTES)
    (payload,) = PacketDecoder().feed(packet(SET_POINT_BYTES))
    assert isinstance(payload, SetPointPayload)
    assert payload.sequence == SET_POINTS.sequence and payload.lifetime_s == pytest.approx(0.1)
    assert payload.pressure_pa == pytest.approx(SET_POINTS.pressure_pa)


@pytest.mark.parametrize(
    ("lifetime_s", "code"), [(0.0004, 0), (-1.0, 0), (0.001, 1), (0.0016, 2), (65.535, 65535), (66.0, 65535)]
)
def test_lifetimes_are_rounded_and_limited(lifetime_s: float, code: int) -> None:
    """Fails when a lifetime wraps around, or is not rounded to milliseconds."""
    content = cobs.decode(encode_set_points(SetPointPayload(1, lifetime_s, np.zeros(1)))[:-1])
    assert struct.unpack_from("<H", content, 6) == (code,)


def test_pressures_are_rounded_to_10_pa_and_limited() -> None:
    """Fails when a pressure wraps around, is cut instead of rounded, or a value that is not finite is sent."""
    codes = pressure_codes(np.array([-50.0, 0.0, 4.0, 6.0, 655350.0, 1e9]))
    assert codes.tolist() == [0, 0, 0, 1, 65535, 65535] and codes.dtype == np.uint16
    for bad in (np.nan, np.inf, -np.inf):
        with pytest.raises(ValueError, match="a set-point is not a finite number"):
            pressure_codes(np.array([0.0, bad]))


def decoded(data: bytes) -> tuple[int, int]:
    """Number of payloads and of packets counted as corrupt."""
    decoder = PacketDecoder()
    return len(decoder.feed(data)), decoder.corrupt


@pytest.mark.parametrize("whole", [SAMPLE_BYTES, SET_POINT_BYTES])
def test_a_payload_of_another_length_is_corrupt(whole: bytes) -> None:
    """Fails when a payload that is longer or shorter than its count is accepted, or raises an error."""
    assert decoded(packet(whole)) == (1, 0)
    for other in (whole + b"\1", whole + b"\1\1", whole[:-1], whole[:-2]):
        assert decoded(packet(other)) == (0, 1)
    for length in range(2, len(whole) - 6):
        assert decoded(packet(whole[:length])) == (0, 1)


def test_a_payload_may_have_no_channels() -> None:
    """Fails when a payload that consists of its fixed fields alone is refused: its count is 0, and it is intact."""
    assert decoded(packet(SAMPLE_BYTES[:18] + b"\0")) == (1, 0)
    assert decoded(packet(SET_POINT_BYTES[:8] + b"\0")) == (1, 0)


@pytest.mark.parametrize("payload", [b"", b"\1"])
def test_a_payload_without_a_head_is_corrupt(payload: bytes) -> None:
    """Fails when a packet that is too short for version and type is parsed."""
    assert decoded(packet(payload)) == (0, 1)


@pytest.mark.parametrize("content", [b"", b"\1", b"\1\1\1", b"\1\1\1\1"])
def test_a_packet_without_a_checksum_is_corrupt(content: bytes) -> None:
    """Fails when a packet that is shorter than a checksum raises an error or is accepted."""
    assert decoded(bytes(cobs.encode(content)) + b"\0") == (0, 1)


def test_an_empty_payload_with_its_checksum_is_corrupt() -> None:
    """Fails when a checksum alone counts as a payload."""
    assert decoded(packet(b"")) == (0, 1)


def test_no_packet_between_two_delimiters_is_no_error() -> None:
    """Fails when repeated delimiters count as corrupt packets."""
    assert decoded(b"\0\0\0" + packet(SAMPLE_BYTES) + b"\0") == (1, 0)


@pytest.mark.parametrize("place", range(len(SAMPLE_BYTES) + 4))
def test_every_damaged_byte_is_found(place: int) -> None:
    """Fails when the checksum does not cover a byte of the payload or itself."""
    content = bytearray(SAMPLE_BYTES + struct.pack("<I", zlib.crc32(SAMPLE_BYTES)))
    content[place] ^= 0x40
    assert decoded(bytes(cobs.encode(bytes(content))) + b"\0") == (0, 1)


def test_bytes_that_are_not_cobs_are_corrupt() -> None:
    """Fails when an invalid code byte raises an error instead of being counted."""
    assert decoded(b"\x05\x01\0") == (0, 1)


def test_an_unknown_type_is_corrupt() -> None:
    """Fails when an unknown type is parsed as a known one."""
    for kind in (0, 5, 255):
        assert decoded(packet(bytes([1, kind]) + SAMPLE_BYTES[2:])) == (0, 1)


@pytest.mark.parametrize("version", [0, 3])
def test_another_version_is_named_and_the_following_bytes_are_kept(version: int) -> None:
    """Fails when another version is parsed, counted as noise, or drops the packets after it."""
    decoder = PacketDecoder()
    with pytest.raises(ProtocolMismatch, match=f"version {version}, this driver uses 2 and 1"):
        decoder.feed(packet(bytes([version]) + SAMPLE_BYTES[1:]) + packet(SAMPLE_BYTES))
    assert decoder.corrupt == 0 and len(decoder.feed(b"")) == 1


def test_a_lifetime_of_zero_is_refused() -> None:
    """Fails when set-points without an end reach a valve."""
    assert decoded(packet(SET_POINT_BYTES[:6] + b"\0\0" + SET_POINT_BYTES[8:])) == (0, 1)


def test_bytes_may_arrive_one_by_one() -> None:
    """Fails when the decoder needs a packet in one piece."""
    decoder = PacketDecoder()
    payloads = [p for byte in packet(SAMPLE_BYTES) * 2 for p in decoder.feed(bytes([byte]))]
    assert len(payloads) == 2 and decoder.corrupt == 0


def test_a_decoder_that_joins_within_a_packet_counts_no_noise() -> None:
    """Fails when the remainder of the first packet counts as corrupt, or later damage does not."""
    decoder, cut = PacketDecoder(joining=True), packet(SAMPLE_BYTES)[7:]
    assert decoder.feed(cut + packet(SAMPLE_BYTES)) and decoder.corrupt == 0
    decoder.feed(cut)
    assert decoder.corrupt == 1
    other = PacketDecoder()
    other.feed(cut)
    assert other.corrupt == 1


def test_an_endless_packet_is_given_up_once() -> None:
    """Fails when noise without a delimiter grows without bound, counts twice, or loses the packet after it."""
    decoder = PacketDecoder()
    assert wire.MAX_PACKET == 1280
    decoder.feed(b"\1" * 1280)
    assert decoder.corrupt == 0 and len(decoder._buffer) == 1280
    decoder.feed(b"\1")
    assert decoder.corrupt == 1 and not decoder._buffer
    decoder.feed(b"\1" * 2000)
    assert decoder.corrupt == 1 and not decoder._buffer
    assert decoder.feed(b"\1\1\0") == [] and decoder.corrupt == 1
    assert len(decoder.feed(packet(SAMPLE_BYTES))) == 1 and decoder.corrupt == 1
