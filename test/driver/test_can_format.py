"""The CAN message layout byte by byte, and every way in which a sequence of messages can be invalid."""

from __future__ import annotations

import struct
import zlib
from dataclasses import replace

import numpy as np
import pytest

from hand_driver import can_wire, wire
from hand_driver.board import ProtocolMismatch, Status
from hand_driver.can_wire import CanAssembler, CanMessage, encode_sample, encode_set_points
from hand_driver.wire import Payload, SamplePayload, SetPointPayload

COUNTS = np.array([1, 258, 65535, 7, 9], np.uint16)
SAMPLE = SamplePayload(0x01020304, 0x1122334455667788, 4.987, Status.SUPPLY_LOW, COUNTS)
SET_POINTS = SetPointPayload(0x01020304, 0.1, np.array([0.0, 1e5, 655350.0, 10.0, 20.0]))


def with_trailer(identifiers: list[int], parts: list[bytes], end: bytes) -> list[CanMessage]:
    crc = zlib.crc32(b"".join(parts) + end)
    return [CanMessage(i, d) for i, d in zip(identifiers, [*parts, struct.pack("<I", crc) + end], strict=True)]


SAMPLE_MESSAGES = with_trailer(
    [0x100, 0x101, 0x110, 0x111, 0x13F],
    [bytes([1, 5, 2, 0, 4, 3, 2, 1]), bytes([0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11]),
     bytes([1, 0, 2, 1, 255, 255, 7, 0]), bytes([9, 0, 0, 0, 0, 0, 0, 0])],
    bytes([4, 3]) + struct.pack("<H", 4987),
)  # fmt: skip
SET_POINT_MESSAGES = with_trailer(
    [0x200, 0x210, 0x211, 0x23F],
    [bytes([1, 5, 100, 0, 4, 3, 2, 1]), bytes([0, 0, 0x10, 0x27, 255, 255, 1, 0]), bytes([2, 0, 0, 0, 0, 0, 0, 0])],
    bytes([4, 3, 0, 0]),
)


def assembled(messages: list[CanMessage]) -> tuple[list[Payload], int]:
    assembler = CanAssembler()
    payloads = [payload for message in messages if (payload := assembler.feed(message)) is not None]
    return payloads, assembler.corrupt


def count_of(messages: list[CanMessage]) -> tuple[int, int]:
    payloads, corrupt = assembled(messages)
    return len(payloads), corrupt


def changed(messages: list[CanMessage], place: int, data: bytes) -> list[CanMessage]:
    return [replace(m, data=data) if k == place else m for k, m in enumerate(messages)]


def test_constants_of_the_layout() -> None:
    """Fails when a number that firmware relies on changes."""
    assert can_wire.ID_OFFSETS == (0x00, 0x40, 0x80, 0xC0)
    assert (wire.VERSIONS, can_wire.MAX_CHANNELS, can_wire.MAX_VALVES, can_wire.MOST_PARTS) == ((1, 2), 40, 16, 64)


def test_a_sample_has_these_messages() -> None:
    """Fails when a field of the sample changes its message, place, width or unit."""
    assert encode_sample(SAMPLE) == SAMPLE_MESSAGES
    (payload,), corrupt = assembled(SAMPLE_MESSAGES)
    assert isinstance(payload, SamplePayload) and corrupt == 0
    assert (payload.sequence, payload.board_time_us) == (SAMPLE.sequence, SAMPLE.board_time_us)
    assert payload.supply_voltage_v == pytest.approx(4.987) and payload.status == Status.SUPPLY_LOW
    assert payload.counts.tolist() == COUNTS.tolist()


def test_set_points_have_these_messages() -> None:
    """Fails when a field of the set-points changes its message, place, width or unit."""
    assert encode_set_points(SET_POINTS) == SET_POINT_MESSAGES
    (payload,), corrupt = assembled(SET_POINT_MESSAGES)
    assert isinstance(payload, SetPointPayload) and corrupt == 0
    assert payload.sequence == SET_POINTS.sequence and payload.lifetime_s == pytest.approx(0.1)
    assert payload.pressure_pa == pytest.approx(SET_POINTS.pressure_pa)


@pytest.mark.parametrize("count", [1, 3, 4, 5, 8, 16, 40])
def test_every_number_of_channels_makes_a_round_trip(count: int) -> None:
    """Fails when the last message of a sample is missing, or one too many is sent."""
    counts = np.arange(count, dtype=np.uint16)
    messages = encode_sample(replace(SAMPLE, counts=counts))
    assert len(messages) == 3 + -(-count // 4) and all(len(message.data) == 8 for message in messages)
    (payload,), _ = assembled(messages)
    assert isinstance(payload, SamplePayload) and payload.counts.tolist() == counts.tolist()
    if count <= 16:
        (payload,), _ = assembled(encode_set_points(SetPointPayload(1, 0.1, 10.0 * counts.astype(np.float64))))
        assert isinstance(payload, SetPointPayload) and payload.pressure_pa == pytest.approx(10.0 * counts)


def test_more_than_a_message_can_count_is_refused() -> None:
    """Fails when a sample or set-points without channels, or with too many, are sent."""
    for count in (0, 41):
        with pytest.raises(ValueError, match=f"{count} channels; CAN carries 1 to 40"):
            encode_sample(replace(SAMPLE, counts=np.zeros(count, np.uint16)))
    for count in (0, 17):
        with pytest.raises(ValueError, match=f"{count} valves; CAN carries 1 to 16"):
            encode_set_points(SetPointPayload(1, 0.1, np.zeros(count)))


@pytest.mark.parametrize(("lifetime_s", "code"), [(0.0004, 0), (-1.0, 0), (0.0016, 2), (65.535, 65535), (66.0, 65535)])
def test_lifetimes_are_rounded_and_limited(lifetime_s: float, code: int) -> None:
    """Fails when a lifetime wraps around, or is not rounded to milliseconds."""
    header = encode_set_points(SetPointPayload(1, lifetime_s, np.zeros(1)))[0]
    assert struct.unpack_from("<H", header.data, 2) == (code,)


@pytest.mark.parametrize("messages", [SAMPLE_MESSAGES, SET_POINT_MESSAGES], ids=["sample", "set-points"])
def test_a_message_that_is_lost_repeated_or_out_of_place_voids_the_whole(messages: list[CanMessage]) -> None:
    """Fails when an incomplete sample or set of set-points is accepted, or the next one is lost with it."""
    last = len(messages) - 1
    for lost in range(1, last + 1):
        rest = messages[:lost] + messages[lost + 1 :]
        assert count_of(rest + messages) == (1, 1), lost
    for repeated in range(1, last):
        assert count_of(messages[: repeated + 1] + messages[repeated:] + messages) == (1, 1), repeated
    for place in range(1, last):
        swapped = [*messages[:place], messages[place + 1], messages[place], *messages[place + 2 :]]
        assert count_of(swapped + messages) == (1, 1), place
    assert count_of(messages[1:]) == (0, 0)  # joined within: no error
    assert count_of(messages[:1] * 2 + messages[1:]) == (1, 1)  # a header within


@pytest.mark.parametrize("messages", [SAMPLE_MESSAGES, SET_POINT_MESSAGES], ids=["sample", "set-points"])
@pytest.mark.parametrize("byte", range(8))
def test_every_damaged_byte_is_found(messages: list[CanMessage], byte: int) -> None:
    """Fails when the checksum does not cover a byte of a message, the trailer included."""
    for place in range(len(messages)):
        data = bytearray(messages[place].data)
        data[byte] ^= 0x10
        if place == 0 and byte < 2:
            continue  # version and count decide how the messages are read: tested below
        assert count_of(changed(messages, place, bytes(data))) == (0, 1), place


@pytest.mark.parametrize("length", [0, 7, 9])
def test_a_message_of_another_length_is_corrupt(length: int) -> None:
    """Fails when a message that has not 8 bytes is parsed."""
    for messages in (SAMPLE_MESSAGES, SET_POINT_MESSAGES):
        for place in range(len(messages)):
            data = (messages[place].data + b"\0\0")[:length]
            assert count_of(changed(messages, place, data)) == (0, 1), place


@pytest.mark.parametrize(("messages", "most"), [(SAMPLE_MESSAGES, 40), (SET_POINT_MESSAGES, 16)])
def test_a_header_with_an_impossible_count_is_corrupt(messages: list[CanMessage], most: int) -> None:
    """Fails when a header announces no channels or more than the layout has, and is believed."""
    for count, corrupt in ((0, 1), (most + 1, 1), (1, 0), (most, 0)):
        header = bytes([1, count, 0, 0, 0, 0, 0, 9])
        assert count_of([replace(messages[0], data=header)]) == (0, corrupt)


def of_version(version: int, messages: list[CanMessage]) -> list[CanMessage]:
    parts = [bytes([version]) + messages[0].data[1:], *(m.data for m in messages[1:-1])]
    return with_trailer([m.identifier for m in messages], parts, messages[-1].data[4:])


@pytest.mark.parametrize("version", [0, 3])
def test_another_version_is_named(version: int) -> None:
    """Fails when an intact sample of another version is parsed or counted as noise, or set-points of one raise."""
    with pytest.raises(ProtocolMismatch, match=f"version {version}, this driver uses 2 and 1"):
        assembled(of_version(version, SAMPLE_MESSAGES))
    assert count_of(of_version(version, SET_POINT_MESSAGES)) == (0, 1)
    damaged = changed(of_version(version, SAMPLE_MESSAGES), 2, bytes(8))
    assert count_of(damaged) == (0, 1)


def test_a_count_of_another_version_is_not_compared() -> None:
    """Fails when a header of another version is refused for its count, whose meaning is unknown."""
    for version in (0, 3):
        header = CanMessage(0x100, bytes([version, 200, 0, 0, 0, 0, 0, 0]))
        assert count_of([header]) == (0, 0)
    messages = with_trailer([0x100, 0x130, 0x13F], [header.data, bytes(8)], bytes(4))
    with pytest.raises(ProtocolMismatch):
        assembled(messages)


def test_an_endless_sample_of_another_version_is_given_up() -> None:
    """Fails when messages of another version are collected without bound."""
    header = CanMessage(0x100, bytes([3, 1, 0, 0, 0, 0, 0, 0]))
    data = CanMessage(0x120, bytes(8))
    assert count_of([header] + [data] * 63) == (0, 0)
    assert count_of([header] + [data] * 64) == (0, 1)


def test_the_sequence_of_the_trailer_must_be_that_of_the_header() -> None:
    """Fails when the parts of two samples make one."""
    wrong = with_trailer(
        [m.identifier for m in SAMPLE_MESSAGES], [m.data for m in SAMPLE_MESSAGES[:-1]], bytes([5, 3, 0, 0])
    )
    assert count_of(wrong) == (0, 1)


def test_a_lifetime_of_zero_is_refused() -> None:
    """Fails when set-points without an end reach a valve."""
    assert count_of(encode_set_points(replace(SET_POINTS, lifetime_s=0.0))) == (0, 1)


def test_messages_of_other_devices_are_ignored() -> None:
    """Fails when an identifier just outside the ranges disturbs a sample, or counts as corrupt."""
    for identifier in (0x0FF, 0x140, 0x1FF, 0x240):
        foreign = CanMessage(identifier, bytes(8))
        assert count_of([m for message in SAMPLE_MESSAGES for m in (foreign, message)]) == (1, 0)


def test_the_two_directions_may_alternate() -> None:
    """Fails when messages of one direction void those of the other."""
    mixed = [m for k in range(5) for m in (SAMPLE_MESSAGES[k : k + 1] + SET_POINT_MESSAGES[k : k + 1])]
    payloads, corrupt = assembled(mixed)
    assert {type(payload) for payload in payloads} == {SamplePayload, SetPointPayload} and corrupt == 0
