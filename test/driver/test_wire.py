"""The serial wire format: round trips, damage, versions, and the numbers of docs/protocol.md."""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cobs import cobs
from hypothesis import given
from hypothesis import strategies as st

from hand_driver import wire
from hand_driver.board import Echo, ProtocolMismatch, Status
from hand_driver.wire import (
    AnswerPayload,
    OfferPayload,
    PacketDecoder,
    SamplePayload,
    SetPointPayload,
    encode_answer,
    encode_offer,
    encode_sample,
    encode_set_points,
)

PROTOCOL = Path(__file__).parents[2] / "docs" / "protocol.md"


def sample(sequence: int = 7, channels: int = 33) -> SamplePayload:
    return SamplePayload(sequence, 123_456_789, 5.0, Status.VENTED, np.arange(channels, dtype=np.uint16))


samples = st.builds(
    lambda sequence, time_us, supply_mv, status, counts: SamplePayload(
        sequence, time_us, supply_mv * 1e-3, Status(status), np.array(counts, np.uint16)
    ),
    st.integers(0, 2**32 - 1),
    st.integers(0, 2**64 - 1),
    st.integers(0, 65535),
    st.integers(0, 15),
    st.lists(st.integers(0, 65535), min_size=1, max_size=255),
)


def test_constants_of_the_wire() -> None:
    """Fails when a number that firmware relies on changes."""
    assert (wire.VERSIONS, wire.SAMPLE, wire.SET_POINTS, wire.OFFER, wire.ANSWER) == ((1, 2), 1, 2, 3, 4)
    assert (wire.PRESSURE_UNIT_PA, wire.LIFETIME_UNIT_S) == (10.0, 1e-3)
    assert [int(bit) for bit in Status] == [1, 2, 4, 8]


@given(samples, st.integers(1, 64))
def test_samples_survive_the_wire_in_any_chunking(expected: SamplePayload, chunk: int) -> None:
    """Fails when a sample changes on its way, or depends on how the bytes arrive."""
    packet = encode_sample(expected)
    assert packet.count(0) == 1
    decoder = PacketDecoder()
    got = [p for i in range(0, len(packet), chunk) for p in decoder.feed(packet[i : i + chunk])]
    assert len(got) == 1
    payload = got[0]
    assert isinstance(payload, SamplePayload)
    assert payload.counts.tolist() == expected.counts.tolist()
    assert (payload.sequence, payload.board_time_us) == (expected.sequence, expected.board_time_us)
    assert payload.status == expected.status
    assert payload.supply_voltage_v == pytest.approx(expected.supply_voltage_v)
    assert decoder.corrupt == 0


@given(st.lists(st.floats(0.0, 655_350.0), min_size=1, max_size=64), st.floats(0.001, 65.0))
def test_set_points_survive_to_their_resolution(pressure: list[float], lifetime_s: float) -> None:
    """Fails when a set-point is off by more than half of 10 Pa, or its lifetime by more than half a millisecond."""
    (got,) = PacketDecoder().feed(encode_set_points(SetPointPayload(3, lifetime_s, np.array(pressure))))
    assert isinstance(got, SetPointPayload)
    assert np.abs(got.pressure_pa - pressure).max() <= 5.0 + 1e-6
    assert got.lifetime_s == pytest.approx(lifetime_s, abs=5.1e-4)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_never_encoded(value: float) -> None:
    """Fails when a NaN or infinite set-point becomes bytes."""
    with pytest.raises(ValueError, match="not a finite number"):
        encode_set_points(SetPointPayload(0, 0.1, np.array([0.0, value])))


def test_a_lifetime_of_zero_is_refused() -> None:
    """Fails when a set-point can hold for ever."""
    decoder = PacketDecoder()
    assert decoder.feed(encode_set_points(SetPointPayload(0, 0.0, np.zeros(11)))) == []
    assert decoder.corrupt == 1


def test_ten_thousand_damaged_byte_strings() -> None:
    """Fails when damage raises, passes for a frame, or costs the next good frame."""
    seed = 11
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    good = encode_sample(sample())
    for trial in range(10_000):
        damaged = bytearray(good)
        if trial % 2:
            damaged = bytearray(rng.integers(0, 256, rng.integers(1, 200), np.uint8).tobytes())
        else:
            for _ in range(rng.integers(1, 6)):
                damaged[rng.integers(len(damaged))] ^= int(rng.integers(1, 256))
        decoder = PacketDecoder()
        for payload in decoder.feed(bytes(damaged) + b"\x00"):
            # Only an undamaged packet may pass; a flip and its reversal make one.
            assert bytes(damaged).split(b"\x00")[0] == good[:-1], (seed, trial, payload)
        (after,) = decoder.feed(good)
        assert isinstance(after, SamplePayload)
        assert after.sequence == 7


def test_endless_noise_takes_bounded_memory() -> None:
    """Fails when a line without delimiters fills the memory, or loses the first frames after it."""
    decoder = PacketDecoder()
    for _ in range(100):
        assert decoder.feed(b"\x55" * 997) == []
    assert len(decoder._buffer) <= wire.MAX_PACKET + 997
    assert decoder.corrupt == 1
    assert decoder.feed(b"\x00") == []
    assert len(decoder.feed(encode_sample(sample()))) == 1


def test_another_version_is_named() -> None:
    """Fails when a board of another protocol version is taken for noise or for a good board."""
    payload = struct.pack("<BB", 3, 1) + b"what version 3 may hold"
    packet = cobs.encode(payload + struct.pack("<I", zlib.crc32(payload))) + b"\x00"
    with pytest.raises(ProtocolMismatch, match="version 3, this driver uses 2 and 1"):
        PacketDecoder().feed(packet)


def test_the_documents_example_is_what_the_code_sends() -> None:
    """Fails when docs/protocol.md and the code disagree."""
    text = PROTOCOL.read_text(encoding="utf-8")
    shown = [bytes.fromhex(block) for block in re.findall(r"`((?:[0-9a-f]{2} ?){12,})`", text)]
    small = SamplePayload(258, 1_000_000, 5.0, Status.VENTED, np.array([0, 1, 65535], np.uint16))
    order = SetPointPayload(1, 0.1, np.array([0.0, 100_000.0]))
    echo = Echo(7, 0.005, np.array([0.0, 100_000.0]), 8)
    session = 0x2A5F11C3
    assert shown == [
        encode_offer(OfferPayload(1, 2, session)),
        encode_answer(AnswerPayload(2, 2, session)),
        encode_sample(replace(small, version=2, echo=echo)),
        encode_sample(small),
        encode_set_points(replace(order, session=session)),
        encode_set_points(order),
    ]
