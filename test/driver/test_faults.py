"""Every fault of the board emulator through real bytes: the emulated board and the driver's board on one pty."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from hand_driver.board import Board, Counts, Frame, Pressures, Status
from hand_driver.link import FIRST_PAUSE_S, Link
from hand_driver.serial_board import SerialBoard
from hand_driver.wire import OfferPayload, SamplePayload, SetPointPayload
from hand_sim.emulator import Emulator
from hand_sim.faults import Faults
from hand_sim.serial_endpoint import SerialEndpoint

CHANNELS, VALVES, RATE_HZ = 33, 11, 200.0
BATCH = 20  # two batches fit into the buffer of a pty


def counts_of(sequence: int) -> Counts:
    return ((np.arange(CHANNELS) * 7 + sequence) % 1000).astype(np.uint16)


class NumberedPlant:
    """A plant whose counts name their sample."""

    def __init__(self) -> None:
        self.sequence = -1

    def step(self, pressure_pa: Pressures) -> tuple[Counts, float, Status]:
        self.sequence += 1
        return counts_of(self.sequence), 5.0, Status(0)


class Rig:
    """Emulator and board joined by a pty; time passes by ticks only."""

    def __init__(self, path: str, faults: Faults) -> None:
        self.emulator = Emulator(NumberedPlant(), lambda: SerialEndpoint(path), RATE_HZ, VALVES, faults, seed=5)
        self.board = SerialBoard(path, CHANNELS)

    def frames(self, ticks: int) -> list[Frame]:
        """Every frame of this many ticks that the board hands over."""
        got: list[Frame] = []
        for tick in range(1, ticks + 1):
            self.emulator.tick(tick)
            if tick % BATCH == 0 or tick == ticks:
                wait_s = 0.3 if tick == ticks else 0.01
                while (frame := self.board.read(wait_s)) is not None:
                    got.append(frame)
        return got

    def close(self) -> None:
        self.board.close()
        self.emulator.close()


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Callable[[Faults], Rig]]:
    made: list[Rig] = []

    def make(faults: Faults) -> Rig:
        made.append(Rig(str(tmp_path / "board"), faults))
        return made[-1]

    yield make
    for each in made:
        each.close()


def test_without_faults_every_frame_arrives_as_it_was(rig: Callable[[Faults], Rig]) -> None:
    """Fails when the emulator or the link disturbs anything by itself."""
    clean = rig(Faults())
    frames = clean.frames(400)
    assert [frame.sequence for frame in frames] == list(range(400))
    assert [frame.board_time_us for frame in frames] == [5000 * k for k in range(1, 401)]
    assert all(np.array_equal(frame.counts, counts_of(frame.sequence)) for frame in frames)
    assert (clean.board.counters.dropped, clean.board.counters.corrupt) == (0, 0)


def test_dropped_frames_are_counted_one_by_one(rig: Callable[[Faults], Rig]) -> None:
    """Fails when a lost frame is not counted, or the others come out of order or altered."""
    lossy = rig(Faults(drop=0.25))
    frames = lossy.frames(400)
    numbers = [frame.sequence for frame in frames]
    assert numbers == sorted(set(numbers))
    assert 60 < lossy.board.counters.dropped < 140
    assert lossy.board.counters.dropped == numbers[-1] - numbers[0] + 1 - len(numbers)
    assert lossy.board.counters.corrupt == 0
    assert all(np.array_equal(frame.counts, counts_of(frame.sequence)) for frame in frames)


def test_corrupt_frames_are_counted_and_never_handed_over(rig: Callable[[Faults], Rig]) -> None:
    """Fails when a damaged packet passes for a frame, is not counted, or costs its neighbours."""
    noisy = rig(Faults(corrupt=0.25))
    frames = noisy.frames(400)
    assert all(np.array_equal(frame.counts, counts_of(frame.sequence)) for frame in frames)
    lost = 400 - len(frames)
    assert 60 < lost < 140
    assert lost <= noisy.board.counters.corrupt <= 2 * lost  # damage may make a delimiter: two pieces of one packet


def test_a_delay_moves_arrival_and_not_acquisition(rig: Callable[[Faults], Rig]) -> None:
    """Fails when a delayed frame is early, or carries the time of its sending."""
    late = rig(Faults(delay_s=0.05))
    for tick in range(1, 11):
        late.emulator.tick(tick)
    assert late.board.read(0.1) is None
    late.emulator.tick(11)
    frame = late.board.read(2.0)
    assert frame is not None
    assert (frame.sequence, frame.board_time_us) == (0, 5000)


def test_stuck_channels_stick_and_the_others_move(rig: Callable[[Faults], Rig]) -> None:
    """Fails when a stuck channel moves, or takes another one with it."""
    frames = rig(Faults(stuck={3: 777, 5: None})).frames(60)
    assert len(frames) == 60
    for frame in frames:
        expected = counts_of(frame.sequence)
        expected[3], expected[5] = 777, counts_of(0)[5]
        assert np.array_equal(frame.counts, expected)


def test_an_unplugged_link_comes_back_by_back_off_and_repeats_nothing(tmp_path: Path) -> None:
    """Fails when a pulled cable is not noticed, is retried at once for ever, or a frame is handed over twice."""
    path = str(tmp_path / "board")
    now_s = 0.0
    tries: list[float] = []

    def open_board() -> Board:
        tries.append(now_s)
        return SerialBoard(path, CHANNELS)

    faults = Faults(disconnect=((0.5, 0.5),))
    emulator = Emulator(NumberedPlant(), lambda: SerialEndpoint(path), RATE_HZ, VALVES, faults)
    link = Link(open_board, lambda: now_s)
    numbers: list[int] = []
    down: list[float] = []
    errors: set[str] = set()
    try:
        link.read(0.0)
        for tick in range(1, 401):
            now_s = tick / RATE_HZ
            emulator.tick(tick)
            frame = link.read(2.0 if link.up else 0.0)
            if frame is not None:
                numbers.append(frame.sequence)
            if not link.up:
                down.append(now_s)
                errors.add(link.error)
        assert down[0] == pytest.approx(0.5, abs=0.011)
        assert len(errors) == 2
        assert all(path in error for error in errors)  # it is gone; it cannot be opened
        pauses = np.diff([down[0], *tries[1:]])
        assert pauses == pytest.approx([FIRST_PAUSE_S * 2**k for k in range(len(pauses))], abs=0.011)
        assert tries[-2] < 1.0 <= tries[-1]
        assert numbers == sorted(set(numbers))
        assert numbers[-1] == 399
        assert (link.reconnects, link.counters.frames) == (1, len(numbers))
    finally:
        link.close()
        emulator.close()


def test_repeated_frames_are_handed_over_once_and_counted(rig: Callable[[Faults], Rig]) -> None:
    """Fails when the emulator repeats nothing, or a repeated frame reaches the driver."""
    made = rig(Faults(repeat=0.3))
    frames = made.frames(400)
    assert [frame.sequence for frame in frames] == list(range(400))
    assert 80 < made.board.counters.replayed < 160
    assert made.board.counters.dropped == 0


def test_a_board_with_a_wrong_clock_sends_its_own_time(rig: Callable[[Faults], Rig]) -> None:
    """Fails when the error of the clock does not reach the frames, or has the other sign."""
    frames = rig(Faults(clock_error=0.01)).frames(100)
    assert [frame.board_time_us for frame in frames] == [5050 * k for k in range(1, 101)]


def test_a_restarted_board_begins_again_vented_and_without_its_session(tmp_path: Path) -> None:
    """Fails when the emulator keeps sequence, time, session or pressure over a restart."""
    endpoint = SerialEndpoint(str(tmp_path / "board"))
    plant = NumberedPlant()
    emulator = Emulator(plant, lambda: endpoint, RATE_HZ, VALVES, Faults(restart=(0.1,)))
    sent: list[SamplePayload] = []
    endpoint.send = lambda sample, corrupt=False: sent.append(sample)  # type: ignore[method-assign]
    endpoint.session.offer(OfferPayload(1, 2, 7))
    arrived = [SetPointPayload(1, 1.0, np.full(VALVES, 1e5), 7)]
    endpoint.receive = lambda: [arrived.pop()] if arrived else []  # type: ignore[method-assign]
    for tick in range(1, 41):
        emulator.tick(tick)
    emulator.close()
    assert [sample.sequence for sample in sent] == [*range(19), *range(21)]
    assert [sample.board_time_us for sample in sent[19:21]] == [5000, 10_000]
    assert Status.VENTED not in sent[18].status and Status.VENTED in sent[19].status
    assert endpoint.session.session is None and endpoint.session.version == 1
