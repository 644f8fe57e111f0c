"""The driver's serial board against real ptys, and `hand emulate-board` as a process of its own."""

from __future__ import annotations

import os
import re
import select
import signal
import struct
import subprocess
import sys
import threading
import time
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import typer
from cobs import cobs
from typer.testing import CliRunner

from hand_driver.board import Board, BoardError, Counts, Frame, LinkLost, Pressures, ProtocolMismatch, Status
from hand_driver.can_board import CanBoard
from hand_driver.serial_board import SerialBoard
from hand_driver.wire import SamplePayload, SetPointPayload, encode_sample, encode_set_points
from hand_sim.emulator import Emulator
from hand_sim.serial_endpoint import Pty, SerialEndpoint
from hand_tool.emulate_board import emulate_board

ROOT = Path(__file__).parents[2]
CHANNELS, VALVES, RATE_HZ = 33, 11, 200.0
WAIT_S = 20.0


class PressedPlant:
    """A plant that stores the set-points of its valves."""

    def __init__(self) -> None:
        self.applied: list[Pressures] = []

    def step(self, pressure_pa: Pressures) -> tuple[Counts, float, Status]:
        self.applied.append(np.array(pressure_pa))
        return np.zeros(CHANNELS, np.uint16), 5.0, Status(0)


def packet(sequence: int, channels: int = CHANNELS) -> bytes:
    return encode_sample(SamplePayload(sequence, sequence * 5000, 5.0, Status(0), np.zeros(channels, np.uint16)))


@pytest.fixture
def pty(tmp_path: Path) -> Iterator[Pty]:
    made = Pty(str(tmp_path / "board"))
    yield made
    made.close()


@pytest.fixture
def serial_board(pty: Pty) -> Iterator[SerialBoard]:
    made = SerialBoard(pty.name, CHANNELS)
    yield made
    made.close()


def test_what_was_sent_before_the_port_was_opened_is_old(pty: Pty) -> None:
    """Fails when a frame from before a reconnect is handed over as new."""
    for sequence in range(10):
        pty.write(packet(sequence))
    other = os.open(pty.name, os.O_RDONLY | os.O_NOCTTY)
    assert select.select([other], [], [], WAIT_S)[0]  # the old frames lie there
    os.close(other)
    board = SerialBoard(pty.name, CHANNELS)
    try:
        pty.write(packet(50))
        frame = board.read(WAIT_S)
        assert frame is not None
        assert frame.sequence == 50
    finally:
        board.close()


def test_a_packet_in_pieces_is_one_frame(pty: Pty, serial_board: SerialBoard) -> None:
    """Fails when a packet that arrives in pieces is lost, or read returns before it is whole."""
    whole = packet(7)
    for piece in (whole[:1], whole[1:40], whole[40:-1]):
        pty.write(piece)
        assert serial_board.read(0.02) is None
    pty.write(whole[-1:])
    frame = serial_board.read(WAIT_S)
    assert frame is not None
    assert frame.sequence == 7
    assert not frame.counts.flags.writeable
    assert frame.received_ns <= time.monotonic_ns()


def test_another_version_is_named_with_ours(pty: Pty, serial_board: SerialBoard) -> None:
    """Fails when a board of another protocol version looks like a noisy line."""
    payload = struct.pack("<BB", 9, 1) + bytes(20)
    pty.write(cobs.encode(payload + struct.pack("<I", zlib.crc32(payload))) + b"\x00")
    with pytest.raises(ProtocolMismatch, match=r"version 9.* 1$"):
        serial_board.read(WAIT_S)


def test_another_number_of_channels_is_named(pty: Pty, serial_board: SerialBoard) -> None:
    """Fails when another hand's board is taken for this one's."""
    pty.write(packet(1, channels=32))
    with pytest.raises(ProtocolMismatch, match="32 channels; the description has 33"):
        serial_board.read(WAIT_S)


def test_a_pulled_cable_is_a_lost_link(tmp_path: Path) -> None:
    """Fails when a port that has gone reads as silence or raises something else."""
    pty = Pty(str(tmp_path / "board"))
    board = SerialBoard(pty.name, CHANNELS)
    pty.close()
    with pytest.raises(LinkLost, match=str(tmp_path)):
        board.read(WAIT_S)
    with pytest.raises(LinkLost, match=str(tmp_path)):
        board.write(np.zeros(VALVES), 0.1)
    board.close()
    board.close()


def test_close_ends_a_read_in_another_thread(serial_board: SerialBoard) -> None:
    """Fails when a driver that is asked to stop hangs in its read."""
    begun = threading.Event()
    ended: list[BaseException] = []

    def wait() -> None:
        begun.set()
        try:
            serial_board.read(60.0)
        except LinkLost as error:
            ended.append(error)

    reader = threading.Thread(target=wait, daemon=True)
    reader.start()
    assert begun.wait(WAIT_S)
    serial_board.close()
    reader.join(WAIT_S)
    assert len(ended) == 1


def test_writes_during_a_read_arrive_whole(tmp_path: Path) -> None:
    """Fails when set-points written by two threads during a read are mixed or lost."""
    port = SerialEndpoint(str(tmp_path / "board"))
    board = SerialBoard(str(tmp_path / "board"), CHANNELS)
    reader = threading.Thread(target=lambda: board.read(0.5))

    def write(base: float) -> None:
        for k in range(30):
            board.write(np.full(VALVES, base + 10.0 * k), 0.1)

    writers = [threading.Thread(target=write, args=(base,)) for base in (1e5, 2e5)]
    for thread in (reader, *writers):
        thread.start()
    orders: list[SetPointPayload] = []
    end_s = time.monotonic() + WAIT_S
    while len(orders) < 60 and time.monotonic() < end_s:
        orders += port.receive()
    for thread in (reader, *writers):
        thread.join()
    board.close()
    port.close()
    assert all(len(set(order.pressure_pa)) == 1 for order in orders)
    first = sorted(order.pressure_pa[0] for order in orders)
    assert first == [base + 10.0 * k for base in (1e5, 2e5) for k in range(30)]
    assert board.counters.written == 60


@pytest.mark.parametrize("made", [False, True])
def test_a_port_that_is_not_valid_is_one_line(tmp_path: Path, made: bool) -> None:
    """Fails when a missing port or a plain file is not named, or pyserial's own exception escapes."""
    path = tmp_path / "no_port"
    if made:
        path.write_text("a file")
    with pytest.raises(BoardError, match="ports of this machine") as raised:
        SerialBoard(str(path), CHANNELS)
    assert str(path) in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_port_in_use_is_refused(pty: Pty, serial_board: SerialBoard) -> None:
    """Fails when two drivers share one board."""
    with pytest.raises(BoardError, match="cannot be opened"):
        SerialBoard(pty.name, CHANNELS)


def test_set_points_act_for_their_lifetime_and_no_longer(tmp_path: Path) -> None:
    """Fails when the watchdog is early, late or silent, or another number of valves is taken."""
    path = str(tmp_path / "board")
    plant = PressedPlant()
    emulator = Emulator(plant, lambda: SerialEndpoint(path), RATE_HZ, VALVES)
    board = SerialBoard(path, CHANNELS)
    frames: list[Frame] = []
    try:
        board.write(np.full(VALVES, 2e5), 0.1)
        board.write(np.full(VALVES - 1, 3e5), 0.1)
        for tick in range(1, 200):
            emulator.tick(tick)
            frame = board.read(WAIT_S)
            assert frame is not None
            frames.append(frame)
    finally:
        board.close()
        emulator.close()
    driven = [k for k, pressure in enumerate(plant.applied) if pressure.any()]
    assert driven == list(range(driven[0], driven[0] + 20))  # 0.1 s
    assert all(np.array_equal(plant.applied[k], np.full(VALVES, 2e5)) for k in driven)
    said = {frame.sequence for frame in frames if not frame.status & Status.VENTED}
    assert said == set(driven)


def test_the_board_takes_nothing_but_intact_set_points(tmp_path: Path) -> None:
    """Fails when damaged, foreign or endless set-points move a valve, or stop those that follow."""
    seed = 3
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    path = str(tmp_path / "board")
    port = SerialEndpoint(path)
    line = os.open(path, os.O_RDWR | os.O_NOCTTY)
    good = encode_set_points(SetPointPayload(1, 0.1, np.full(VALVES, 1e5)))
    foreign = struct.pack("<BB", 2, 2) + bytes(30)
    bad = [
        bytes(cobs.encode(foreign + struct.pack("<I", zlib.crc32(foreign)))) + b"\x00",
        encode_set_points(SetPointPayload(2, 0.0, np.full(VALVES, 3e5))),
        packet(4),
    ]
    for _ in range(200):
        damaged = bytearray(good)
        damaged[rng.integers(len(damaged) - 1)] ^= int(rng.integers(1, 256))
        bad.append(bytes(damaged) + b"\x00")
    orders: list[SetPointPayload] = []
    try:
        for each in bad:
            os.write(line, each)
            orders += port.receive()
        os.write(line, b"\x00" + good)
        end_s = time.monotonic() + WAIT_S
        while not any(order.pressure_pa[0] == 1e5 for order in orders) and time.monotonic() < end_s:
            orders += port.receive()
    finally:
        os.close(line)
        port.close()
    assert [order.pressure_pa.tolist() for order in orders] == [[1e5] * VALVES]


class Served:
    """`hand emulate-board` in a process of its own."""

    def __init__(self, *arguments: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "hand_tool.emulate_board", "--quiet", *arguments],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        self.ready = self.process.stdout.readline()

    def end(self, number: signal.Signals) -> tuple[int, str]:
        """Exit code and what was said on stderr."""
        self.process.send_signal(number)
        _, said = self.process.communicate(timeout=WAIT_S)
        return self.process.returncode, said


@pytest.fixture
def served(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Served]:
    made = Served(f"--{request.param}", str(tmp_path / "board"))
    yield made
    if made.process.poll() is None:
        made.process.kill()
    made.process.communicate()


def open_board(link: str, path: Path) -> Board:
    return SerialBoard(str(path), CHANNELS) if link == "serial" else CanBoard("slcan", str(path), CHANNELS)


@pytest.mark.parametrize(
    ("served", "link", "number"),
    [("serial", "serial", signal.SIGINT), ("can", "can", signal.SIGTERM)],
    indirect=["served"],
)
def test_another_process_serves_the_hand(served: Served, link: str, number: signal.Signals, tmp_path: Path) -> None:
    """Fails when bytes do not cross processes, set-points have no effect or no end, or a signal ends it badly."""
    path = tmp_path / "board"
    assert re.fullmatch(rf"ready: .*{re.escape(str(path))}.*, 33 channels, 200 Hz\n", served.ready)
    board = open_board(link, path)
    frames: list[Frame] = []

    def read_until_vented_is(vented: bool) -> None:
        end_s = time.monotonic() + WAIT_S
        while time.monotonic() < end_s:
            frame = board.read(WAIT_S)
            assert frame is not None
            frames.append(frame)
            if bool(frame.status & Status.VENTED) is vented:
                return
        pytest.fail(f"status VENTED did not become {vented}")

    read_until_vented_is(True)
    board.write(np.full(VALVES, 2e5), 0.1)
    read_until_vented_is(False)
    read_until_vented_is(True)
    board.close()
    driven = [frame.sequence for frame in frames if not frame.status & Status.VENTED]
    assert driven[-1] - driven[0] < 20  # 0.1 s; a stalled host may have missed some
    numbers = np.array([frame.sequence for frame in frames])
    times_us = np.array([frame.board_time_us for frame in frames])
    assert np.array_equal(np.diff(times_us), 5000 * np.diff(numbers))
    assert (np.diff(numbers) > 0).all()
    code, said = served.end(number)
    assert (code, said) == (0, "")
    assert not path.is_symlink()


@pytest.mark.parametrize("served", ["serial"], indirect=True)
def test_a_killed_emulator_is_a_pulled_cable_and_its_place_can_be_taken(served: Served, tmp_path: Path) -> None:
    """Fails when a board that dies reads as silence, or what it leaves behind blocks the next one."""
    board = open_board("serial", tmp_path / "board")
    assert board.read(WAIT_S) is not None
    served.end(signal.SIGKILL)
    end_s = time.monotonic() + WAIT_S
    with pytest.raises(LinkLost):
        while time.monotonic() < end_s:
            board.read(0.1)
    board.close()
    assert (tmp_path / "board").is_symlink()  # left behind
    again = SerialEndpoint(str(tmp_path / "board"))
    board = open_board("serial", tmp_path / "board")
    board.close()
    again.close()


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("--serial", "a", "--can", "b"),
        ("--serial", "board", "--drop", "1.5"),
        ("--serial", "board", "--corrupt", "nan"),
        ("--serial", "board", "--delay", "-1"),
        ("--serial", "board", "--disconnect", "soon"),
        ("--serial", "board", "--disconnect", "1:0"),
        ("--serial", "board", "--stuck", "33"),
        ("--serial", "board", "--stuck", "3=x"),
        ("--serial", "board", "--stuck", "3=70000"),
        ("--serial", "board", "--deaf", "soon"),
        ("--serial", "board", "--deaf-valve", "11"),
        ("--serial", "board", "--lose", "1.5"),
        ("--serial", "board", "--repeat", "-0.1"),
        ("--serial", "board", "--clock-error", "1"),
        ("--serial", "board", "--model", "nowhere.yaml"),
        ("--serial", "no_such_folder/board"),
        ("--can", "x", "--can-interface", "no_such_thing"),
    ],
)
def test_bad_options_are_one_line_and_exit_2(
    arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fails when a wrong option is served, or ends in a traceback or another exit code."""
    monkeypatch.chdir(tmp_path)
    app = typer.Typer(pretty_exceptions_enable=False)
    app.command()(emulate_board)
    result = CliRunner().invoke(app, list(arguments))
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith("hand emulate-board: ")
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "board").is_symlink()
