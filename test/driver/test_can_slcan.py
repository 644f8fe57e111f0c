"""CAN through the emulated slcan adapter: the ASCII on the line, and the driver's CAN board on top of it."""

from __future__ import annotations

import os
import re
import select
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from hand_driver.board import Board, Counts, Frame, LinkLost, Pressures, Status
from hand_driver.can_board import CanBoard
from hand_driver.can_wire import CanMessage, encode_sample, encode_set_points
from hand_driver.link import Link
from hand_driver.wire import SamplePayload, SetPointPayload
from hand_sim.can_endpoint import SlcanEndpoint
from hand_sim.emulator import Emulator
from hand_sim.faults import Faults
from hand_sim.serial_endpoint import Pty

CHANNELS, VALVES, RATE_HZ = 33, 11, 200.0
WAIT_S = 20.0
COUNTS = np.arange(CHANNELS, dtype=np.uint16) * 1000


def sample(sequence: int) -> SamplePayload:
    return SamplePayload(sequence, sequence * 5000, 4.987, Status.SUPPLY_LOW, COUNTS)


def lines(messages: list[CanMessage]) -> bytes:
    """Messages as an slcan host or adapter writes them."""
    return b"".join(f"t{m.identifier:03X}8{m.data.hex().upper()}\r".encode() for m in messages)


class Line:
    """The host's end of the serial line, byte for byte."""

    def __init__(self, path: str) -> None:
        self.descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY)

    def say(self, data: bytes) -> None:
        os.write(self.descriptor, data)

    def hear(self, size: int) -> bytes:
        """Exactly size bytes, or fewer when no more come."""
        heard = b""
        while len(heard) < size and select.select([self.descriptor], [], [], 2.0)[0]:
            heard += os.read(self.descriptor, size - len(heard))
        return heard

    def silent(self) -> bool:
        return not select.select([self.descriptor], [], [], 0.1)[0]


@pytest.fixture
def port(tmp_path: Path) -> Iterator[SlcanEndpoint]:
    made = SlcanEndpoint(str(tmp_path / "adapter"))
    yield made
    made.close()


@pytest.fixture
def line(port: SlcanEndpoint, tmp_path: Path) -> Iterator[Line]:
    made = Line(str(tmp_path / "adapter"))
    yield made
    os.close(made.descriptor)


def orders_of(port: SlcanEndpoint, enough: int = 1) -> list[SetPointPayload]:
    """Orders until there are enough or none come."""
    got: list[SetPointPayload] = []
    end_s = time.monotonic() + WAIT_S
    while len(got) < enough and time.monotonic() < end_s:
        got += port.receive()
    return got


def obey(port: SlcanEndpoint, line: Line, command: bytes) -> bytes:
    """The adapter's answer to a command."""
    line.say(command)
    end_s = time.monotonic() + WAIT_S
    while time.monotonic() < end_s:
        port.receive()
        if select.select([line.descriptor], [], [], 0.01)[0]:
            return line.hear(1)
    return b""


def test_the_channel_is_silent_until_it_is_opened(port: SlcanEndpoint, line: Line) -> None:
    """Fails when the adapter does not execute O and C, or answers a command otherwise than by a carriage return."""
    port.send(sample(1))
    assert line.silent()
    assert obey(port, line, b"S8\r") == b"\r"
    assert obey(port, line, b"O\r") == b"\r"
    expected = lines(encode_sample(SamplePayload(1, 5000, 4.987, Status.SUPPLY_LOW, COUNTS)))
    port.send(sample(1))
    assert line.hear(len(expected)) == expected
    assert obey(port, line, b"C\r") == b"\r"
    port.send(sample(2))
    assert line.silent()


def test_frames_on_the_line_are_what_an_adapter_sends(port: SlcanEndpoint, line: Line) -> None:
    """Fails when the ASCII differs from t, three digits of identifier, length 8 and eight bytes."""
    obey(port, line, b"O\r")
    port.send(sample(0x01020304))
    heard = line.hear(12 * 22).split(b"\r")[:-1]
    assert len(heard) == 12
    assert all(re.fullmatch(rb"t[0-9A-F]{3}8[0-9A-F]{16}", each) for each in heard)
    assert heard[0] == b"t1008" + b"0121020004030201"
    assert heard[2] == b"t1108" + b"0000E803D007B80B"


def test_damaged_lines_cost_nothing_but_themselves(port: SlcanEndpoint, line: Line) -> None:
    """Fails when noise on the line raises, passes for set-points, or stops those that follow."""
    seed = 4
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    good = lines(encode_set_points(SetPointPayload(5, 0.1, np.full(VALVES, 1e5))))
    obey(port, line, b"O\r")
    got: list[SetPointPayload] = []
    for trial in range(1000):
        if trial % 2:
            damaged = bytearray(good)
            at = int(rng.integers(len(damaged) - 1))
            damaged[at] = int(rng.choice([b for b in range(1, 256) if b != damaged[at] and chr(b) not in "COLSL\r"]))
        else:
            noise = rng.bytes(int(rng.integers(1, 80)))
            damaged = bytearray(b for b in noise if chr(b) not in "COL")
        line.say(bytes(damaged) + b"\r")
        got += port.receive()
        while select.select([line.descriptor], [], [], 0.0)[0]:
            os.read(line.descriptor, 4096)  # answers to what looked like commands
    assert all(order.pressure_pa.tolist() == [1e5] * VALVES for order in got)
    got = []
    line.say(good)
    got = orders_of(port)
    assert got[-1].pressure_pa.tolist() == [1e5] * VALVES


def test_extended_frames_and_other_identifiers_are_none_of_ours(port: SlcanEndpoint, line: Line) -> None:
    """Fails when another device's traffic voids set-points or passes for them."""
    messages = encode_set_points(SetPointPayload(5, 0.1, np.full(VALVES, 1e5)))
    obey(port, line, b"O\r")
    mixed = b"".join(b"T000002008" + b"FF" * 8 + b"\r" + b"t55510A\r" + lines([m]) for m in messages)
    line.say(mixed)
    (order,) = orders_of(port)
    assert order.pressure_pa.tolist() == [1e5] * VALVES
    assert order.lifetime_s == pytest.approx(0.1)


def test_extended_frames_do_not_reach_the_assembler(tmp_path: Path) -> None:
    """Fails when the driver takes another device's 29-bit identifier for one of ours."""
    adapter = Pty(str(tmp_path / "adapter"))
    board = CanBoard("slcan", adapter.name, CHANNELS)
    try:
        whole = encode_sample(SamplePayload(9, 45_000, 5.0, Status(0), COUNTS))
        for message in whole:
            adapter.write(f"T{message.identifier:08X}8{'00' * 8}\r".encode() + lines([message]))
        frame = board.read(WAIT_S)
        assert frame is not None
        assert frame.sequence == 9
        assert board.counters.corrupt == 0
    finally:
        board.close()
        adapter.close()


class PressedPlant:
    """A plant that stores the set-points of its valves."""

    def __init__(self) -> None:
        self.applied: list[Pressures] = []

    def step(self, pressure_pa: Pressures) -> tuple[Counts, float, Status]:
        self.applied.append(np.array(pressure_pa))
        return COUNTS.copy(), 5.0, Status(0)


class Rig:
    """Emulator and the driver's CAN board joined by the adapter; time passes by ticks only."""

    def __init__(self, path: str, faults: Faults) -> None:
        self.plant = PressedPlant()
        self.emulator = Emulator(self.plant, lambda: SlcanEndpoint(path), RATE_HZ, VALVES, faults, seed=6)
        self.board = CanBoard("slcan", path, CHANNELS)
        self.tick = 0

    def step(self, timeout_s: float) -> Frame | None:
        self.tick += 1
        self.emulator.tick(self.tick)
        return self.board.read(timeout_s)

    def close(self) -> None:
        self.board.close()
        self.emulator.close()


def opened(path: str, faults: Faults) -> Rig:
    """A rig whose adapter has seen the host's commands: the first frame has come through."""
    rig = Rig(path, faults)
    end_s = time.monotonic() + WAIT_S
    while rig.step(0.01) is None:
        assert time.monotonic() < end_s, "no frame came through the adapter"
    return rig


def test_set_points_over_can_act_for_their_lifetime_and_no_longer(tmp_path: Path) -> None:
    """Fails when frames are altered, set-points do not arrive, or the watchdog is early or late."""
    rig = opened(str(tmp_path / "adapter"), Faults())
    try:
        rig.board.write(np.full(VALVES, 2e5), 0.1)
        frames = [rig.step(WAIT_S) for _ in range(100)]
    finally:
        rig.close()
    assert all(frame is not None and np.array_equal(frame.counts, COUNTS) for frame in frames)
    driven = [k for k, pressure in enumerate(rig.plant.applied) if pressure.any()]
    assert driven == list(range(driven[0], driven[0] + 20))  # 0.1 s
    said = {frame.sequence for frame in frames if frame is not None and not frame.status & Status.VENTED}
    assert said == set(driven)
    assert rig.board.counters.dropped == rig.board.counters.corrupt == 0


def test_faults_on_can_are_counted_and_never_handed_over(tmp_path: Path) -> None:
    """Fails when a damaged or lost sample passes for a frame or is not counted."""
    rig = opened(str(tmp_path / "adapter"), Faults(drop=0.2, corrupt=0.2))
    try:
        frames = [frame for _ in range(150) if (frame := rig.step(0.03)) is not None]
        while (frame := rig.board.read(0.3)) is not None:
            frames.append(frame)
    finally:
        rig.close()
    assert 60 < len(frames) < 130  # 0.64 of 150
    assert all(np.array_equal(frame.counts, COUNTS) for frame in frames)
    numbers = [frame.sequence for frame in frames]
    assert numbers == sorted(set(numbers))
    assert rig.board.counters.corrupt > 10
    assert rig.board.counters.dropped > rig.board.counters.corrupt


def test_a_pulled_adapter_is_a_lost_link(tmp_path: Path) -> None:
    """Fails when an adapter that has gone reads as silence for ever, or its end raises something else."""
    rig = opened(str(tmp_path / "adapter"), Faults())
    rig.emulator.close()
    end_s = time.monotonic() + WAIT_S
    with pytest.raises(LinkLost, match=str(tmp_path)):
        while time.monotonic() < end_s:
            rig.board.read(0.1)
    with pytest.raises(LinkLost, match=str(tmp_path)):
        rig.board.write(np.zeros(VALVES), 0.1)
    rig.board.close()
    rig.board.close()


def test_an_unplugged_adapter_comes_back_and_repeats_nothing(tmp_path: Path) -> None:
    """Fails when the driver does not return to an adapter that was plugged in again, or repeats a frame."""
    path = str(tmp_path / "adapter")
    now_s = 0.0
    emulator = Emulator(PressedPlant(), lambda: SlcanEndpoint(path), RATE_HZ, VALVES, Faults(disconnect=((0.5, 0.4),)))

    def open_board() -> Board:
        return CanBoard("slcan", path, CHANNELS)

    link = Link(open_board, lambda: now_s)
    numbers: list[int] = []
    tick = 0
    end_s = time.monotonic() + WAIT_S
    try:
        while (link.reconnects < 1 or numbers[-1] < 200) and time.monotonic() < end_s:
            tick += 1
            now_s = tick / RATE_HZ
            emulator.tick(tick)
            frame = link.read(0.02 if link.up else 0.0)
            if frame is not None:
                numbers.append(frame.sequence)
        assert link.reconnects == 1
        assert numbers == sorted(set(numbers))
        assert numbers[0] < 90
        assert not any(100 <= number < 175 for number in numbers)
        assert link.counters.frames == len(numbers)
    finally:
        link.close()
        emulator.close()
