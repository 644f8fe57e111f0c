"""What a CAN board or another device may do wrong: counts out of range, repeats, foreign versions, a full adapter."""

from __future__ import annotations

import re
import threading
from dataclasses import replace
from pathlib import Path

import can
import numpy as np
import pytest

from hand_driver.board import BoardError, Echo, LinkLost, ProtocolMismatch, Status
from hand_driver.can_board import CanBoard, open_bus
from hand_driver.can_wire import CanAssembler, CanMessage, encode_answer, encode_offer, encode_sample, encode_set_points
from hand_driver.can_wire import _trailer as trailer
from hand_driver.wire import AnswerPayload, OfferPayload, Payload, SamplePayload, SetPointPayload
from hand_sim.can_endpoint import CanEndpoint, SlcanEndpoint

DOCUMENT = Path(__file__).parents[2] / "docs" / "protocol_can.md"
SAMPLE = SamplePayload(70_000, 123_456_789, 4.987, Status.VENTED, np.arange(33, dtype=np.uint16) * 1000)
ORDER = SetPointPayload(9, 0.1, np.full(11, 1e5))
WAIT_S = 10.0


def feed(assembler: CanAssembler, messages: list[CanMessage]) -> list[Payload]:
    return [got for message in messages if (got := assembler.feed(message)) is not None]


def announced(header: int, count: int, version: int = 1, between: int = 0) -> list[CanMessage]:
    """Messages with a right CRC whose header announces this count, with as many zeros behind it."""
    first = CanMessage(header, bytes([version, count, 1, 0, 5, 0, 0, 0]))
    fixed = [CanMessage(0x101, bytes(8))] if header == 0x100 else []
    data = [CanMessage(header + 0x10 + i, bytes(8)) for i in range(min(between or -(-count // 4), 0x2F))]
    parts = [first, *fixed, *data]
    return [*parts, CanMessage(header + 0x3F, trailer(parts, 5, 0))]


@pytest.mark.parametrize(
    ("header", "count"), [(0x100, n) for n in (0, 41, 189, 255)] + [(0x200, n) for n in (0, 17, 255)]
)
def test_counts_out_of_range_are_damage(header: int, count: int) -> None:
    """Fails when an intact message with an impossible count raises, passes, or costs the good ones behind it."""
    assembler = CanAssembler()
    messages = [m for m in announced(header, count) if m.identifier != header + 0x3E]  # which are offers and answers
    assert feed(assembler, messages) == []
    assert assembler.corrupt == 1
    assert len(feed(assembler, [*encode_sample(SAMPLE), *encode_set_points(ORDER)])) == 2


@pytest.mark.parametrize(("count", "between"), [(33, 0), (0, 3), (200, 45)])
def test_another_version_is_named_whatever_its_layout(count: int, between: int) -> None:
    """Fails when a sample of another version is taken for noise because its other fields mean something else."""
    with pytest.raises(ProtocolMismatch, match="version 3, this driver uses 2 and 1"):
        feed(CanAssembler(), announced(0x100, count, 3, between))


def test_set_points_of_another_version_are_not_evidence_about_the_board() -> None:
    """Fails when set-points of another host make a driver close its board, or reach a valve."""
    assembler = CanAssembler()
    assert feed(assembler, announced(0x200, 11, 3)) == []
    assert assembler.corrupt == 1


def test_both_directions_may_be_interleaved() -> None:
    """Fails when set-points on the bus between the messages of a sample void either."""
    sample, order = encode_sample(SAMPLE), encode_set_points(ORDER)
    for at in range(1, len(sample)):
        assembler = CanAssembler()
        assert len(feed(assembler, [*sample[:at], *order, *sample[at:]])) == 2, at
        assert assembler.corrupt == 0


def test_a_repeated_sample_is_handed_over_once() -> None:
    """Fails when a whole sample that is sent twice passes for a new one."""
    port, board = CanEndpoint("virtual", "hand_twice", 1_000_000), CanBoard("virtual", "hand_twice", 33)
    sample = SamplePayload(7, 35_000, 5.0, Status(0), SAMPLE.counts)
    try:
        port.send(sample)
        port.send(sample)
        assert board.read(1.0) is not None
        assert board.read(0.05) is None
        assert (board.counters.frames, board.counters.replayed, board.counters.corrupt) == (1, 1, 0)
    finally:
        board.close()
        port.close()


def test_two_hands_share_a_bus() -> None:
    """Fails when a hand reads the other's samples, or a board takes the other's set-points."""
    ports = [CanEndpoint("virtual", "hand_pair", 1_000_000, offset) for offset in (0x00, 0x40)]
    boards = [CanBoard("virtual", "hand_pair", 33, id_offset=offset) for offset in (0x00, 0x40)]
    try:
        for number, port in enumerate(ports):
            port.send(SamplePayload(number, 5000, 5.0, Status(0), SAMPLE.counts))
        frames = [board.read(1.0) for board in boards]
        assert [frame and frame.sequence for frame in frames] == [0, 1]
        boards[1].write(np.full(11, 2e5), 0.1)
        assert [len(port.receive()) for port in ports] == [0, 1]
        assert [board.counters.corrupt for board in boards] == [0, 0]
    finally:
        for board in boards:
            board.close()
        for port in ports:
            port.close()


def test_an_offset_that_would_overlap_is_named() -> None:
    """Fails when two hands can be given overlapping identifiers."""
    with pytest.raises(BoardError, match=r"0x20 is not one of 0x00, 0x40, 0x80, 0xc0"):
        CanBoard("virtual", "hand_pair", 33, id_offset=0x20)


@pytest.mark.parametrize("flags", [{"is_error_frame": True}, {"is_remote_frame": True}, {"is_extended_id": True}])
def test_only_data_messages_reach_the_emulated_board(flags: dict[str, bool]) -> None:
    """Fails when an error report, whose identifier can be that of a header, voids set-points."""
    port, bus = CanEndpoint("virtual", "hand_error", 1_000_000), open_bus("virtual", "hand_error", 1_000_000)
    strange = can.Message(arbitration_id=0x200, **{"is_extended_id": False, **flags})
    messages = [
        can.Message(arbitration_id=m.identifier, data=m.data, is_extended_id=False) for m in encode_set_points(ORDER)
    ]
    try:
        for message in (messages[0], strange, *messages[1:]):
            bus.send(message)
        assert len(port.receive()) == 1
    finally:
        bus.shutdown()
        port.close()


def test_the_speed_of_an_adapter_may_stand_behind_its_name(tmp_path: Path) -> None:
    """Fails when a channel such as /dev/ttyACM0@115200 is lost at its first silence."""
    port = SlcanEndpoint(str(tmp_path / "adapter"))
    board = CanBoard("slcan", f"{tmp_path / 'adapter'}@115200", 33)
    try:
        assert board.read(0.02) is None
    finally:
        board.close()
        port.close()


def test_an_adapter_that_takes_nothing_is_a_lost_link(tmp_path: Path) -> None:
    """Fails when writing to an adapter that has stopped reading blocks for ever: commands would stop with it."""
    port = SlcanEndpoint(str(tmp_path / "adapter"))
    board = CanBoard("slcan", str(tmp_path / "adapter"), 33)
    raised: list[Exception] = []

    def write() -> None:
        try:
            for _ in range(5000):
                board.write(np.zeros(11), 0.1)
        except LinkLost as error:
            raised.append(error)

    writer = threading.Thread(target=write, daemon=True)
    writer.start()
    writer.join(WAIT_S)
    blocked = writer.is_alive()
    port.close()
    board.close()
    assert not blocked
    assert "adapter" in str(raised[0])


def test_the_adapter_answers_questions(tmp_path: Path) -> None:
    """Fails when a host's questions for version, number and faults, or an unknown command, get no answer of theirs."""
    port = SlcanEndpoint(str(tmp_path / "adapter"))
    try:
        for question, answer in (
            (b"V", b"V0101\r"),
            (b"N", b"N0001\r"),
            (b"F", b"F00\r"),
            (b"S8", b"\r"),
            (b"?", b"\a"),
        ):
            with Path(tmp_path / "adapter").open("r+b", buffering=0) as line:
                line.write(question + b"\r")
                port.receive()
                assert line.read(16) == answer
    finally:
        port.close()


def test_the_example_of_the_document_is_true() -> None:
    """Fails when the worked example a firmware engineer tests against is not what we send and read."""
    lines = re.findall(r"^(1[0-9A-F]{2}|2[0-9A-F]{2})((?: [0-9A-F]{2}){8})", DOCUMENT.read_text(), re.MULTILINE)
    shown = [CanMessage(int(identifier, 16), bytes.fromhex(data)) for identifier, data in lines]
    sample = SamplePayload(70_000, 123_456_789, 4.987, Status.VENTED, np.array([0, 1000, 2000, 3000, 65535], np.uint16))
    order = SetPointPayload(9, 0.1, np.array([0.0, 1e5, 2e5, 3e5, 655_350.0]))
    session = 0x2A5F11C3
    echo = Echo(8, 0.01, order.pressure_pa, 9)
    assert shown == [
        *encode_sample(sample),
        *encode_set_points(order),
        encode_offer(OfferPayload(1, 2, session)),
        encode_answer(AnswerPayload(2, 2, session)),
        *encode_sample(replace(sample, status=Status(0), version=2, echo=echo)),
        *encode_set_points(replace(order, session=session)),
    ]
    assert len(feed(CanAssembler(), shown)) == 6


def signed(parts: list[CanMessage], identifier: int, sequence_low: int) -> list[CanMessage]:
    """The parts with a trailer whose CRC is right."""
    return [*parts, CanMessage(identifier, trailer(parts, sequence_low, 0))]


@pytest.mark.parametrize("kind", ["missing", "out of order", "other sequence"])
def test_a_right_crc_does_not_make_up_for_a_broken_layout(kind: str) -> None:
    """Fails when a board that computes its CRC over a broken sample is believed."""
    parts = encode_sample(SAMPLE)[:-1]
    if kind == "missing":
        del parts[5]
    elif kind == "out of order":
        parts[4], parts[5] = parts[5], parts[4]
    sequence_low = 70_000 + (kind == "other sequence")
    assembler = CanAssembler()
    assert feed(assembler, signed(parts, 0x13F, sequence_low)) == []
    assert assembler.corrupt == 1


def test_set_points_without_lifetime_are_refused() -> None:
    """Fails when set-points that would hold for no time, or for ever, are accepted."""
    parts = encode_set_points(ORDER)[:-1]
    parts[0] = CanMessage(0x200, parts[0].data[:2] + bytes(2) + parts[0].data[4:])
    assert feed(CanAssembler(), signed(parts, 0x23F, 9)) == []


def test_closing_an_adapter_that_is_gone_releases_it(tmp_path: Path) -> None:
    """Fails when every reconnect leaves a descriptor open."""
    port = SlcanEndpoint(str(tmp_path / "adapter"))
    board = CanBoard("slcan", str(tmp_path / "adapter"), 33)
    line = board._bus.serialPortOrig
    port.close()
    board.close()
    assert not line.is_open
