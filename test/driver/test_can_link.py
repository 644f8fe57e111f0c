"""The CAN layout message by message against the DBC, random traffic, and CAN between two processes."""

from __future__ import annotations

import select
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can
import cantools
import numpy as np
import pytest

from hand_driver import can_wire
from hand_driver.board import BoardError, Counts, Echo, Frame, LinkLost, ProtocolMismatch, Status
from hand_driver.can_board import CanBoard, open_bus
from hand_driver.can_wire import CanAssembler, CanMessage, encode_answer, encode_offer, encode_sample, encode_set_points
from hand_driver.wire import AnswerPayload, OfferPayload, SamplePayload, SetPointPayload
from hand_sim.can_endpoint import SlcanEndpoint

ROOT = Path(__file__).parents[2]
DBC = cantools.database.load_file(Path(can_wire.__file__).with_name("hand_board.dbc"))
WAIT_S = 20.0
SESSION = 0x9ABCDEF0
ECHO = """
import sys, time
import numpy as np
from hand_driver.board import Status
from hand_sim.can_endpoint import SlcanEndpoint
from hand_driver.wire import SamplePayload
port = SlcanEndpoint(sys.argv[1])
counts = np.zeros(33, np.uint16)
print("ready", flush=True)
for sequence in range(100_000):
    for order in port.receive():
        counts[:11] = np.rint(order.pressure_pa / 10.0)
        counts[11] = round(order.lifetime_s * 1e3)
    port.send(SamplePayload(sequence, 5000 * sequence, 4.987, Status(0), counts))
    time.sleep(0.005)
"""
"""A board in a process of its own: the set-points it holds come back as counts."""


def full_sample() -> SamplePayload:
    counts = np.array([(7919 * (i + 1)) % 65536 for i in range(40)], np.uint16)
    status = Status.SUPPLY_LOW | Status.ADC_FAULT
    echo = Echo(0x76543210, 1.234, np.arange(16, dtype=np.float64) * 23_450.0, 200)
    return SamplePayload(0xFEDCBA98, 0x0123456789ABCDEF, 4.987, status, counts, 2, echo)


def full_set_points() -> SetPointPayload:
    return SetPointPayload(0x89ABCDEF, 0.25, np.arange(16, dtype=np.float64) * 12_340.0, SESSION)


def everything() -> list[CanMessage]:
    """All messages of both directions, at full size."""
    offers = [encode_offer(OfferPayload(1, 2, SESSION)), encode_answer(AnswerPayload(2, 2, SESSION))]
    return [*encode_sample(full_sample()), *encode_set_points(full_set_points()), *offers]


def a_sample(sequence: int) -> SamplePayload:
    return SamplePayload(sequence, sequence * 5000, 5.0, Status(0), np.full(33, sequence, np.uint16))


def test_every_message_of_the_dbc_is_sent_and_nothing_else() -> None:
    """Fails when a message of the DBC is never sent at full size, or one is sent that the DBC does not have."""
    sent = {m.identifier for m in everything()}
    assert sent == {message.frame_id for message in DBC.messages}


@pytest.mark.parametrize("message", DBC.messages, ids=lambda message: message.name)
def test_the_dbc_packs_each_message_as_we_do(message: Any) -> None:
    """Fails when byte order, place or scale of any signal differ between the DBC and our packing."""
    sent, order = full_sample(), full_set_points()
    assert sent.echo is not None
    ours = {m.identifier: m.data for m in everything()}
    data = ours[message.frame_id]
    values: dict[str, float] = {
        "Version": 2, "Channels": 40, "Valves": 16, "Status": 10, "BoardTime": sent.board_time_us,
        "SupplyVoltage": 4.987, "Lifetime": 250, "Reserved": 0, "Crc": int.from_bytes(data[:4], "little"),
    }  # fmt: skip
    check = int.from_bytes(data[2:4], "little")
    values |= {"EchoValves": 16, "EchoAccepted": 200, "EchoAge": 1234, "EchoSequence": sent.echo.sequence}
    values |= {"Session": SESSION, "SessionReserved": 0, "OfferLowest": 1, "OfferHighest": 2, "OfferCheck": check}
    values |= {"AnswerVersion": 2, "AnswerHighest": 2, "AnswerCheck": check, "OfferSession": SESSION}
    values |= {"AnswerSession": SESSION}
    values |= {f"Echo{i}": float(pressure) for i, pressure in enumerate(sent.echo.pressure_pa)}
    own = sent.sequence if message.frame_id < can_wire.SET_POINT_HEADER else order.sequence
    values |= {"Sequence": own, "SequenceLow": own & 0xFFFF}
    values |= {f"Channel{i}": int(count) for i, count in enumerate(sent.counts)}
    values |= {f"Pressure{i}": float(pressure) for i, pressure in enumerate(order.pressure_pa)}
    wanted = {signal.name: values[signal.name] for signal in message.signals}
    assert message.encode(wanted) == data
    assert message.decode(data) == pytest.approx(wanted)


def test_random_traffic_yields_nothing_and_harms_nothing() -> None:
    """Fails when random messages raise, pass for a sample or set-points, or cost the good sample behind them."""
    seed = 52
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    good = encode_sample(full_sample())
    known = [message.frame_id for message in DBC.messages]
    assembler = CanAssembler()
    for trial in range(10_000):
        identifier = int(rng.choice(known)) if trial % 3 else int(rng.integers(0, 0x800))
        data = bytearray(rng.bytes(8 if trial % 5 else int(rng.integers(0, 9))))
        if trial % 2 and data:
            data[0] = 1 + trial // 2 % 2  # our versions, so that a header is taken for one
        assert assembler.feed(CanMessage(identifier, bytes(data))) is None, (seed, trial)
        if trial % 100 == 0:
            got = [payload for message in good if (payload := assembler.feed(message)) is not None]
            assert [p.sequence for p in got if isinstance(p, SamplePayload)] == [0xFEDCBA98], (seed, trial)


def test_messages_of_two_samples_mixed_are_no_sample() -> None:
    """Fails when parts of different samples are put together to one."""
    first = encode_sample(full_sample())
    other = SamplePayload(0xFEDCBA99, 1, 4.987, Status(0), full_sample().counts[::-1].copy(), 2, full_sample().echo)
    second = encode_sample(other)
    for at in range(1, len(first)):
        assembler = CanAssembler()
        mixed = [assembler.feed(message) for message in [*first[:at], *second[at:]]]
        assert mixed == [None] * len(first), at
        assert assembler.corrupt == 1


def test_another_version_on_the_bus_stops_the_board() -> None:
    """Fails when the board hands over a frame of another protocol version, or does not name both versions."""
    board = CanBoard("virtual", "hand_version", 33)
    bus = open_bus("virtual", "hand_version", 1_000_000)
    parts = encode_sample(full_sample())[:-1]
    parts[0] = CanMessage(parts[0].identifier, b"\x07" + parts[0].data[1:])
    foreign = [*parts, CanMessage(0x13F, can_wire._trailer(parts, 0xFEDCBA98, 4987))]
    try:
        for message in foreign:
            bus.send(can.Message(arbitration_id=message.identifier, data=message.data, is_extended_id=False))
        with pytest.raises(ProtocolMismatch, match="version 7, this driver uses 2 and 1"):
            board.read(1.0)
    finally:
        board.close()
        bus.shutdown()


def test_what_lay_in_the_adapter_before_opening_is_not_read(tmp_path: Path) -> None:
    """Fails when samples left over from an earlier connection are handed over as new ones."""
    path = str(tmp_path / "adapter")
    port = SlcanEndpoint(path)
    earlier = CanBoard("slcan", path, 33)
    try:
        port.receive()
        for sequence in range(200):  # far more than the terminal keeps: nobody reads
            port.send(a_sample(sequence))
        board = CanBoard("slcan", path, 33)
        port.receive()
        port.send(a_sample(1000))
        frame = board.read(1.0)
        assert frame is not None
        assert frame.sequence == 1000
        board.close()
    finally:
        port.close()
        earlier.close()


def test_opening_an_adapter_is_quick(tmp_path: Path) -> None:
    """Fails when python-can's pause of 2 s after opening a serial port is back: each reconnect would cost it."""
    port = SlcanEndpoint(str(tmp_path / "adapter"))
    try:
        begun_s = time.monotonic()
        CanBoard("slcan", str(tmp_path / "adapter"), 33).close()
        assert time.monotonic() - begun_s < 1.0
    finally:
        port.close()


def test_a_missing_socketcan_channel_is_one_line() -> None:
    """Fails when a CAN interface that does not exist is not named, or python-can's own exception escapes."""
    with pytest.raises(BoardError, match="no_such0") as raised:
        CanBoard("socketcan", "no_such0", 33)
    assert "\n" not in str(raised.value)


@pytest.fixture
def echo(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    path = str(tmp_path / "adapter")
    child = subprocess.Popen([sys.executable, "-c", ECHO, path], stdout=subprocess.PIPE, cwd=ROOT)
    assert child.stdout is not None
    try:
        assert select.select([child.stdout], [], [], WAIT_S)[0], "the board did not start"
        assert child.stdout.readline() == b"ready\n"
        yield child, path
    finally:
        child.kill()
        child.wait()
        child.stdout.close()


def until(board: CanBoard, expected: Counts) -> Frame:
    """The first frame whose first counts are as expected."""
    end_s = time.monotonic() + WAIT_S
    while time.monotonic() < end_s:
        frame = board.read(0.1)
        if frame is not None and np.array_equal(frame.counts[: len(expected)], expected):
            return frame
    raise AssertionError("the board never reported the set-points")


def test_both_directions_between_two_processes(echo: tuple[subprocess.Popen[bytes], str]) -> None:
    """Fails when set-points or counts change on their way between processes, or writing disturbs reading."""
    board = CanBoard("slcan", echo[1], 33)
    last = np.array([*range(5000, 16_000, 1000), 250], np.uint16)

    def write() -> None:
        for scale in range(50):
            board.write(np.full(11, 1e3 * scale), 0.1)
        board.write(last[:11].astype(np.float64) * 10.0, 0.25)

    writer = threading.Thread(target=write)
    try:
        assert board.read(WAIT_S) is not None
        writer.start()
        frame = until(board, last)
        assert frame.supply_voltage_v == pytest.approx(4.987)
        assert frame.board_time_us == 5000 * frame.sequence
        assert not frame.counts[12:].any()
        assert 0 <= time.monotonic_ns() - frame.received_ns < 1e9
        assert (board.counters.dropped, board.counters.corrupt, board.counters.written) == (0, 0, 51)
    finally:
        writer.join()
        board.close()


def test_a_killed_board_is_a_lost_link_within_a_second(echo: tuple[subprocess.Popen[bytes], str]) -> None:
    """Fails when the death of the other process reads as silence, takes over 1 s, or raises something else."""
    child, path = echo
    board = CanBoard("slcan", path, 33)
    try:
        assert board.read(WAIT_S) is not None
        child.kill()
        child.wait()
        begun_s = time.monotonic()
        with pytest.raises(LinkLost, match=path):
            while time.monotonic() - begun_s < WAIT_S:
                board.read(0.1)
        assert time.monotonic() - begun_s < 1.0
    finally:
        board.close()
