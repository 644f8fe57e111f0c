"""Version 2 of the protocol on real bytes: echo, replays in both directions, boards of version 1, restarts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from hand_driver.board import Board, Counts, Frame, Pressures, Status
from hand_driver.can_board import CanBoard
from hand_driver.can_wire import encode_sample as encode_can_sample
from hand_driver.serial_board import SerialBoard
from hand_driver.wire import (
    OfferPayload,
    SamplePayload,
    SetPointPayload,
    encode_offer,
    encode_sample,
    encode_set_points,
)
from hand_sim.can_endpoint import CanEndpoint
from hand_sim.emulator import BoardEndpoint, Emulator
from hand_sim.serial_endpoint import Pty, SerialEndpoint

CHANNELS, VALVES, RATE_HZ = 33, 11, 200.0
WAIT_S = 20.0
LINKS = ["serial", "can"]


class Plant:
    """A plant that notes the pressures of its valves."""

    def __init__(self) -> None:
        self.applied: list[Pressures] = []

    def step(self, pressure_pa: Pressures) -> tuple[Counts, float, Status]:
        self.applied.append(np.array(pressure_pa))
        return np.zeros(CHANNELS, np.uint16), 5.0, Status(0)


class Rig:
    """Emulator and board on one link; time passes by ticks only."""

    def __init__(self, link: str, path: Path, protocol: int) -> None:
        self.plant = Plant()
        self.link, self.path = link, str(path / "board")
        self.emulator = Emulator(self.plant, lambda: self.endpoint(protocol), RATE_HZ, VALVES)
        self.board = self.open()
        self.tick = 0

    def endpoint(self, protocol: int) -> BoardEndpoint:
        if self.link == "serial":
            return SerialEndpoint(self.path, protocol=protocol)
        return CanEndpoint("virtual", self.path, 1_000_000, protocol=protocol)

    def open(self) -> Board:
        if self.link == "serial":
            return SerialBoard(self.path, CHANNELS)
        return CanBoard("virtual", self.path, CHANNELS)

    def step(self) -> Frame:
        self.tick += 1
        self.emulator.tick(self.tick)
        frame = self.board.read(WAIT_S)
        assert frame is not None
        return frame

    def close(self) -> None:
        self.board.close()
        self.emulator.close()


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Callable[[str, int], Rig]]:
    made: list[Rig] = []

    def make(link: str, protocol: int = 2) -> Rig:
        made.append(Rig(link, tmp_path, protocol))
        return made[-1]

    yield make
    for each in made:
        each.close()


@pytest.mark.parametrize("link", LINKS)
def test_the_board_echoes_what_acts_on_its_valves(rig: Callable[..., Rig], link: str) -> None:
    """Fails when version 2 is not agreed on, or sequence, values, age or count of the echo are wrong."""
    made = rig(link)
    for _ in range(4):
        made.step()
    assert made.board.protocol == 2
    frame = made.step()
    assert frame.echo is not None
    assert math.isnan(frame.echo.age_s) and not frame.echo.pressure_pa.any()
    for k in range(300):
        wanted = np.array([1e4 * valve + 10.0 * k for valve in range(VALVES)])
        sequence = made.board.write(wanted, 0.1)
        made.step()  # takes the set-points over at its end
        frame = made.step()
        assert frame.echo is not None
        assert frame.echo.pressure_pa == pytest.approx(wanted)
        assert np.array_equal(made.plant.applied[-1], frame.echo.pressure_pa)
        assert (frame.echo.sequence, frame.echo.accepted) == (sequence, (k + 1) % 256)
        assert frame.echo.age_s == pytest.approx(1 / RATE_HZ)
    for _ in range(30):
        frame = made.step()
    assert Status.VENTED in frame.status and frame.echo is not None
    assert not frame.echo.pressure_pa.any()
    assert frame.echo.age_s == pytest.approx(31 / RATE_HZ)


@pytest.mark.parametrize("link", LINKS)
def test_a_board_of_version_1_works_without_an_echo(rig: Callable[..., Rig], link: str) -> None:
    """Fails when an older board is refused, is not driven, or an echo is invented for it."""
    made = rig(link, 1)
    for _ in range(20):
        made.step()
    made.board.write(np.full(VALVES, 2e5), 0.1)
    made.step()
    frame = made.step()
    assert made.board.protocol == 1
    assert frame.echo is None and Status.VENTED not in frame.status
    assert made.plant.applied[-1].tolist() == [2e5] * VALVES
    assert made.board.counters.corrupt == 0


@pytest.mark.parametrize("link", LINKS)
def test_another_host_gets_a_session_of_its_own(rig: Callable[..., Rig], link: str) -> None:
    """Fails when a driver that starts again is ignored, or echoes of its predecessor pass for its own."""
    made = rig(link)
    for _ in range(4):
        made.step()
    for _ in range(5):
        made.board.write(np.full(VALVES, 2e5), 0.1)
        made.step()
    made.board.close()
    made.board = made.open()
    frames = [made.step() for _ in range(4)]
    assert frames[0].echo is None
    assert made.board.protocol == 2
    assert frames[-1].echo is not None and math.isnan(frames[-1].echo.age_s)
    assert made.board.write(np.full(VALVES, 1e5), 0.1) == 0
    made.step()
    frame = made.step()
    assert frame.echo is not None
    assert frame.echo.pressure_pa.tolist() == [1e5] * VALVES and frame.echo.sequence == 0


def test_set_points_repeated_by_the_line_do_not_act(tmp_path: Path) -> None:
    """Fails when a line that repeats a packet extends its lifetime or brings an old pressure back."""
    endpoint = SerialEndpoint(str(tmp_path / "board"))
    line = Path(endpoint.description.split()[1])
    session = 99
    packets = [encode_set_points(SetPointPayload(k, 0.1, np.full(VALVES, 1e4 * k), session)) for k in range(20)]
    try:
        with line.open("r+b", buffering=0) as host:
            host.write(encode_offer(OfferPayload(1, 2, session)))
            assert endpoint.receive() == []
            for k, packet in enumerate(packets):
                host.write(packet + packets[k // 2] + packet)
                assert [s.sequence for s in endpoint.receive()] == [k]
    finally:
        endpoint.close()


SEED = 21


@pytest.mark.parametrize("version", [1, 2])
def test_a_serial_line_that_repeats_frames_yields_each_once(tmp_path: Path, version: int) -> None:
    """Fails when a repeated packet, alone or in a block, becomes a new frame, or is not counted."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    pty = Pty(str(tmp_path / "board"))
    board = SerialBoard(pty.name, CHANNELS)
    sent = [
        encode_sample(SamplePayload(k, 5000 * k, 5.0, Status(0), np.full(CHANNELS, k, np.uint16), version))
        for k in range(400)
    ]
    got: list[int] = []
    repeats = 0
    try:
        for k, packet in enumerate(sent):
            again = sent[int(rng.integers(0, k + 1)) :][: min(int(rng.integers(0, 5)), k + 1)]
            again = [each for each in again if each in sent[: k + 1]]
            repeats += len(again)
            pty.write(packet + b"".join(again))
            while (frame := board.read(0.002 if len(got) <= k else 0.0)) is not None:
                got.append(frame.sequence)
        while (frame := board.read(0.05)) is not None:
            got.append(frame.sequence)
    finally:
        board.close()
        pty.close()
    assert got == list(range(400))
    assert (board.counters.replayed, board.counters.frames, board.counters.dropped) == (repeats, 400, 0)
    assert repeats > 300


def test_a_can_bus_that_repeats_frames_yields_each_once() -> None:
    """Fails when a repeated or older sample on the bus becomes a new frame, or is not counted."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    port = CanEndpoint("virtual", "hand_repeats", 1_000_000)
    board = CanBoard("virtual", "hand_repeats", CHANNELS)
    repeats = 0
    try:
        for k in range(100):
            numbers = [k, *rng.integers(0, k + 1, int(rng.integers(0, 4))).tolist()]
            repeats += len(numbers) - 1
            for number in numbers:
                port.send(SamplePayload(number, 5000 * number, 5.0, Status(0), np.full(CHANNELS, number, np.uint16)))
            frame = board.read(WAIT_S)
            assert frame is not None
            assert frame.sequence == k
        assert board.read(0.02) is None
        assert (board.counters.replayed, board.counters.dropped) == (repeats, 0)
    finally:
        board.close()
        port.close()
    assert len(encode_can_sample(SamplePayload(0, 0, 5.0, Status(0), np.zeros(CHANNELS, np.uint16)))) == 12
