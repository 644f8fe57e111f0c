"""The driver's serial board against the board sample in C, over a real pty, with faults of the line between them."""

from __future__ import annotations

import contextlib
import os
import select
import subprocess
import threading
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from cobs import cobs

from hand_driver.board import Frame, Status
from hand_driver.measurement import Converter
from hand_driver.serial_board import SerialBoard
from hand_driver.wire import OFFER, SET_POINTS
from hand_model.description import load_hand
from validation.c_programs import host_board

ROOT = Path(__file__).parents[2]
HAND = load_hand(ROOT / "config" / "hand.yaml")
VALVES, LIFETIME_S, WAIT_S = HAND.valve_count, 0.1, 20.0
Filter = Callable[[bytes], bytes]


class Line:
    """A pty on the host's side, the process of the board on the other; whole packets pass through a filter each way."""

    def __init__(self) -> None:
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self.master, False)
        self.port = os.ttyname(self._slave)
        command = [str(host_board()), str(round(HAND.rate_hz))]
        self._board = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        assert self._board.stdin is not None and self._board.stdout is not None
        self._to_board, self._from_board = self._board.stdin.fileno(), self._board.stdout.fileno()
        self.to_board: Filter = lambda packet: packet
        self.to_host: Filter = lambda packet: packet
        self.sent: list[bytes] = []
        self._lock = threading.Lock()
        self._open = True
        self._thread = threading.Thread(target=self._forward, daemon=True)
        self._thread.start()

    def _forward(self) -> None:
        rests = {self.master: b"", self._from_board: b""}
        while self._open:
            for source in select.select(list(rests), [], [], 0.05)[0]:
                *packets, rests[source] = (rests[source] + os.read(source, 4096)).split(b"\x00")
                for packet in packets:
                    self._pass(source, packet + b"\x00")

    def _pass(self, source: int, packet: bytes) -> None:
        if source == self.master:
            self.sent.append(packet)
            self.inject(self.to_board(packet))
        else:
            with contextlib.suppress(BlockingIOError):  # nobody reads: bytes are lost, as on a line
                os.write(self.master, self.to_host(packet))

    def inject(self, data: bytes) -> None:
        """Send bytes to the board."""
        with self._lock:
            os.write(self._to_board, data)

    def close(self) -> None:
        self._open = False
        self._thread.join()
        self._board.communicate(timeout=WAIT_S)  # closes its input, which ends it
        for descriptor in (self.master, self._slave):
            os.close(descriptor)


@pytest.fixture
def line() -> Iterator[Line]:
    made = Line()
    yield made
    made.close()


@pytest.fixture
def board(line: Line) -> Iterator[SerialBoard]:
    made = SerialBoard(line.port, HAND.channel_count)
    yield made
    made.close()


def frames(board: SerialBoard, pressure_pa: float | None, until: Callable[[Frame], bool]) -> list[Frame]:
    """Frames up to the first that satisfies a condition, with set-points written after each; fails after WAIT_S."""
    got: list[Frame] = []
    end_s = time.monotonic() + WAIT_S
    while time.monotonic() < end_s:
        frame = board.read(0.1)
        if frame is None:
            continue
        got.append(frame)
        if until(frame):
            return got
        if pressure_pa is not None:
            board.write(np.full(VALVES, pressure_pa), LIFETIME_S)
    raise AssertionError(f"no such frame; the last one is {got[-1] if got else None}")


def in_force(frame: Frame) -> float:
    """The highest set-point that acts, from the echo."""
    return float(max(frame.echo.pressure_pa)) if frame.echo is not None else 0.0


def armed(frame: Frame) -> bool:
    return Status.VENTED not in frame.status


def drive(board: SerialBoard, pressure_pa: float) -> list[Frame]:
    """Wait for protocol 2, arm by zero set-points, and drive until the pressure is in force."""
    frames(board, 0.0, lambda _: board.protocol == 2)
    frames(board, 0.0, armed)
    return frames(board, pressure_pa, lambda frame: in_force(frame) == pressure_pa)


def test_the_driver_drives_the_board_in_c(board: SerialBoard) -> None:
    """Fails when driver and firmware do not agree on a version, the pressure jumps, or does not arrive."""
    driven = drive(board, 2e5)
    levels = [in_force(frame) for frame in driven]
    assert max(np.diff(levels)) < 3e4, "a ramp, not a jump"
    settled = frames(board, 2e5, lambda frame: frame.board_time_us - driven[-1].board_time_us > 700_000)
    assert all(armed(frame) for frame in settled)
    measured = Converter(HAND, 0.0).convert(settled[-1])
    assert measured.pressure == pytest.approx(np.full(VALVES, 2e5), abs=2e3)
    sequences = [frame.sequence for frame in (*driven, *settled)]
    assert board.counters.corrupt == 0 and sequences == sorted(set(sequences))


def test_silence_vents_and_only_a_request_drives_again(board: SerialBoard) -> None:
    """Fails when set-points outlive a silent driver, or come back without zero set-points before them."""
    begun = drive(board, 1e5)[-1]
    silent = frames(board, None, lambda frame: not armed(frame))
    assert silent[-1].board_time_us - begun.board_time_us < (LIFETIME_S + 0.2) * 1e6
    later = silent[-1].board_time_us + 200_000
    refused = frames(board, 1e5, lambda frame: frame.board_time_us > later)
    assert all(in_force(frame) == 0.0 and not armed(frame) for frame in refused[1:])
    frames(board, 0.0, armed)
    back = frames(board, 1e5, lambda frame: in_force(frame) == 1e5)
    assert len(back) > 10, "pressure returns along a ramp"


def test_replayed_packets_change_nothing(line: Line, board: SerialBoard) -> None:
    """Fails when recorded set-points act again, or keep a board driven whose driver is silent."""
    drive(board, 3e5)
    recorded = [packet for packet in line.sent if cobs.decode(packet[:-1])[1] == SET_POINTS][-20:]
    frames(board, 1e5, lambda frame: in_force(frame) == 1e5)
    line.to_board = lambda packet: packet + b"".join(recorded[:3])
    seen = frames(board, 1e5, lambda frame, count=[0]: count.append(0) or len(count) > 60)  # type: ignore[misc]
    assert {in_force(frame) for frame in seen} == {1e5}
    stop = threading.Event()

    def replay() -> None:
        while not stop.wait(0.01):
            line.inject(b"".join(recorded))

    thread = threading.Thread(target=replay)
    thread.start()
    try:
        frames(board, None, lambda frame: not armed(frame))
    finally:
        stop.set()
        thread.join()


def test_damaged_packets_are_counted_and_do_not_act(line: Line, board: SerialBoard) -> None:
    """Fails when a damaged packet reaches a valve or the driver as good, or noise stops a hand that can still run."""
    rng = np.random.default_rng(4)
    print("seed 4")

    def noise(packet: bytes) -> bytes:
        if rng.random() > 0.2:
            return packet
        damaged = bytearray(packet)
        damaged[rng.integers(len(packet) - 1)] ^= 1 << int(rng.integers(8))
        return bytes(damaged)

    drive(board, 1e5)
    line.to_board = line.to_host = noise
    seen = frames(board, 1e5, lambda frame, count=[0]: count.append(0) or len(count) > 150)  # type: ignore[misc]
    assert {in_force(frame) for frame in seen} <= {1e5, 0.0}
    assert sum(in_force(frame) == 1e5 for frame in seen) > 100
    assert board.counters.corrupt > 5


def test_a_driver_of_version_1_is_served(line: Line, board: SerialBoard) -> None:
    """Fails when a host that never offers a session cannot drive the board."""
    line.to_board = lambda packet: b"" if cobs.decode(packet[:-1])[1] == OFFER else packet
    frames(board, 0.0, armed)
    begun = frames(board, 1e5, lambda _: True)[0]
    driven = frames(board, 1e5, lambda frame: frame.board_time_us - begun.board_time_us > 600_000)
    measured = Converter(HAND, 0.0).convert(driven[-1])
    assert board.protocol == 1 and driven[-1].echo is None
    assert measured.pressure == pytest.approx(np.full(VALVES, 1e5), abs=2e3)
