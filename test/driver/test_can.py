"""The CAN layout: round trips, damage, the DBC file, and the board's side of a real bus."""

from __future__ import annotations

from pathlib import Path

import cantools
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hand_driver import can_wire
from hand_driver.board import BoardError, ProtocolMismatch, Status
from hand_driver.can_board import CanBoard
from hand_driver.can_wire import CanAssembler, CanMessage, encode_sample, encode_set_points
from hand_driver.wire import SamplePayload, SetPointPayload
from hand_sim.can_endpoint import CanEndpoint

DBC = Path(can_wire.__file__).with_name("hand_board.dbc")


def sample(sequence: int = 70_000, channels: int = 33) -> SamplePayload:
    counts = np.arange(channels, dtype=np.uint16) * 1000
    return SamplePayload(sequence, 2**40 + 5, 4.987, Status.VENTED, counts)


def feed(assembler: CanAssembler, messages: list[CanMessage]) -> list[object]:
    return [got for message in messages if (got := assembler.feed(message)) is not None]


def test_identifiers_of_the_bus() -> None:
    """Fails when an identifier that firmware relies on changes."""
    identifiers = [message.identifier for message in encode_sample(sample(channels=5))]
    assert identifiers == [0x100, 0x101, 0x110, 0x111, 0x13F]
    identifiers = [m.identifier for m in encode_set_points(SetPointPayload(0, 0.1, np.zeros(11)))]
    assert identifiers == [0x200, 0x210, 0x211, 0x212, 0x23F]


@given(st.lists(st.integers(0, 65535), min_size=1, max_size=40), st.integers(0, 2**32 - 1))
def test_samples_survive_the_bus(counts: list[int], sequence: int) -> None:
    """Fails when a sample changes on its way."""
    expected = SamplePayload(sequence, 12345, 5.0, Status.SUPPLY_LOW, np.array(counts, np.uint16))
    (got,) = feed(CanAssembler(), encode_sample(expected))
    assert isinstance(got, SamplePayload)
    assert got.counts.tolist() == counts
    assert (got.sequence, got.board_time_us, got.status) == (sequence, 12345, Status.SUPPLY_LOW)


@given(st.lists(st.floats(0.0, 655_350.0), min_size=1, max_size=16))
def test_set_points_survive_the_bus(pressure: list[float]) -> None:
    """Fails when a set-point is off by more than half of 10 Pa."""
    (got,) = feed(CanAssembler(), encode_set_points(SetPointPayload(9, 0.1, np.array(pressure))))
    assert isinstance(got, SetPointPayload)
    assert np.abs(got.pressure_pa - pressure).max() <= 5.0 + 1e-6


def test_the_dbc_says_what_we_send() -> None:
    """Fails when the published DBC and our packing disagree in any field."""
    database = cantools.database.load_file(DBC)
    decoded: dict[str, float] = {}
    for message in encode_sample(sample()):
        decoded |= database.decode_message(message.identifier, message.data)
    assert (decoded["Version"], decoded["Channels"], decoded["Status"]) == (1, 33, 1)
    assert (decoded["Sequence"], decoded["SequenceLow"]) == (70_000, 70_000 & 0xFFFF)
    assert decoded["BoardTime"] == 2**40 + 5
    assert decoded["SupplyVoltage"] == pytest.approx(4.987)
    assert [decoded[f"Channel{i}"] for i in range(33)] == sample().counts.tolist()
    decoded = {}
    for message in encode_set_points(SetPointPayload(4, 0.25, np.arange(11, dtype=np.float64) * 1e4)):
        decoded |= database.decode_message(message.identifier, message.data)
    assert (decoded["Valves"], decoded["Lifetime"], decoded["Sequence"]) == (11, 250, 4)
    assert [decoded[f"Pressure{i}"] for i in range(11)] == [i * 1e4 for i in range(11)]


def test_messages_of_the_dbc_are_what_we_read() -> None:
    """Fails when a board built from the DBC is not understood."""
    database = cantools.database.load_file(DBC)
    ours = encode_sample(sample())
    again = [
        CanMessage(m.identifier, database.encode_message(m.identifier, database.decode_message(m.identifier, m.data)))
        for m in ours
    ]
    assert again == ours


def test_ten_thousand_disturbed_samples() -> None:
    """Fails when a lost, repeated, swapped or damaged message yields a sample, or costs the next good one."""
    seed = 12
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    good = encode_sample(sample())
    for trial in range(10_000):
        messages = list(good)
        at = int(rng.integers(len(messages)))
        kind = trial % 4
        if kind == 0:
            del messages[at]
        elif kind == 1:
            messages.insert(at, messages[at])
        elif kind == 2:
            data = bytearray(messages[at].data)
            data[rng.integers(8)] ^= int(rng.integers(1, 256))
            messages[at] = CanMessage(messages[at].identifier, bytes(data))
        else:
            size = int(rng.integers(0, 9))
            messages[at] = CanMessage(int(rng.integers(0, 0x800)), rng.bytes(size))
        assembler = CanAssembler()
        got = feed(assembler, messages)
        for payload in got:  # where the disturbance hit nothing that matters, the true sample and no other
            assert isinstance(payload, SamplePayload)
            assert payload.counts.tolist() == sample().counts.tolist(), (seed, trial)
            assert (payload.sequence, payload.board_time_us) == (70_000, 2**40 + 5), (seed, trial)
        assert len(got) <= 1
        if kind == 2:
            assert got == [], (seed, trial)
        assert len(feed(assembler, good)) == 1, (seed, trial)


def test_another_version_is_named() -> None:
    """Fails when a board of another protocol version is taken for noise or for a good board."""
    messages = encode_sample(sample())[:-1]
    messages[0] = CanMessage(messages[0].identifier, b"\x03" + messages[0].data[1:])
    trailer = CanMessage(can_wire.SAMPLE_TRAILER, can_wire._trailer(messages, 70_000, 0))
    with pytest.raises(ProtocolMismatch, match="version 3, this driver uses 2 and 1"):
        feed(CanAssembler(), [*messages, trailer])


def test_board_and_port_on_one_bus() -> None:
    """Fails when a sample or a set-point does not cross a python-can bus, or a gap is not counted."""
    port = CanEndpoint("virtual", "hand_test", 1_000_000)
    board = CanBoard("virtual", "hand_test", 33)
    try:
        for sequence in (1, 2, 5):
            port.send(SamplePayload(sequence, sequence * 5000, 5.0, Status(0), np.zeros(33, np.uint16)))
            frame = board.read(1.0)
            assert frame is not None
            assert frame.sequence == sequence
        assert board.counters.dropped == 2
        board.write(np.full(11, 2e5), 0.1)
        (order,) = port.receive()
        assert order.pressure_pa.tolist() == [2e5] * 11
        port.send(SamplePayload(6, 1, 5.0, Status(0), np.zeros(33, np.uint16)), corrupt=True)
        assert board.read(0.05) is None
        assert board.counters.corrupt == 1
    finally:
        board.close()
        port.close()


def test_a_wrong_channel_count_is_named() -> None:
    """Fails when a board with other channels is taken for this hand's."""
    port = CanEndpoint("virtual", "hand_count", 1_000_000)
    board = CanBoard("virtual", "hand_count", 33)
    try:
        port.send(SamplePayload(1, 1, 5.0, Status(0), np.zeros(12, np.uint16)))
        with pytest.raises(ProtocolMismatch, match="12 channels; the description has 33"):
            board.read(1.0)
    finally:
        board.close()
        port.close()


@pytest.mark.parametrize(("interface", "channel"), [("no_such_thing", "x"), ("slcan", "/dev/nothing_here")])
def test_an_unknown_bus_is_one_line(interface: str, channel: str) -> None:
    """Fails when a bus that cannot be opened is not named, or python-can's own exception escapes."""
    with pytest.raises(BoardError, match=channel) as raised:
        CanBoard(interface, channel, 33)
    assert interface in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_foreign_message_disturbs_nothing() -> None:
    """Fails when another device's messages on the bus void our samples."""
    messages = encode_sample(sample())
    mixed = [part for message in messages for part in (CanMessage(0x555, b"\x01"), message)]
    assert len(feed(CanAssembler(), mixed)) == 1
