"""Links that fail again and again: nothing may raise, no frame may be used twice, and the link must come back.

Three forms: a link whose board fails at random, with a clock of its own; the emulated board on a real pseudo-terminal
and behind an emulated CAN adapter, both stepped in virtual time. The time runs from the disconnection until the link is
down, the largest pause until it is up again is limited by the back-off.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hand_driver.board import Board, BoardError, Counts, Frame, LinkCounters, LinkLost, Pressures, Status
from hand_driver.can_board import CanBoard
from hand_driver.link import LONGEST_PAUSE_S, Link
from hand_driver.serial_board import SerialBoard
from hand_sim.can_endpoint import SlcanEndpoint
from hand_sim.emulator import BoardEndpoint, Emulator
from hand_sim.serial_endpoint import SerialEndpoint
from validation.faults.result import FaultResult, Size, Tally

FAMILY = "disconnects"
CHANNELS, VALVES, RATE_HZ = 33, 11, 200.0
PRESSURE_PA, LIFETIME_S = 1.0e5, 0.1
STALL_S, GLANCE_S = 0.03, 0.0002
"""Real time for which a read may wait [s] while frames flow, for the bytes are already there, and otherwise."""
NEAR_S = 0.02
"""A disconnection is noticed within this time [s], four frames."""


def run(size: Size, seed: int) -> list[FaultResult]:
    """At least 1,000 disconnects of each form; quick: 100 and 20."""
    return [
        random_failures(size.of(100, 2_000), seed),
        *emulated("serial", SerialEndpoint, serial_board, size.of(15, 1_000), seed),
        *emulated("CAN", SlcanEndpoint, can_board, size.of(15, 1_000), seed),
    ]


def serial_board(path: str) -> Board:
    """The driver's end of a serial line."""
    return SerialBoard(path, CHANNELS)


def can_board(path: str) -> Board:
    """The driver's end of a CAN adapter."""
    return CanBoard("slcan", path, CHANNELS)


class FailingBoard(Board):
    """A board that gives some frames, then fails on reading, on writing or on closing."""

    def __init__(self, rng: np.random.Generator, number: Callable[[], int]) -> None:
        """Fail after a random number of frames."""
        self._left = int(rng.integers(0, 12))
        self._writes = bool(rng.random() < 0.3)
        self._number = number
        self._made = LinkCounters()

    @property
    def counters(self) -> LinkCounters:
        """See Board.counters."""
        return self._made

    def read(self, timeout_s: float) -> Frame | None:
        """See Board.read."""
        if self._left <= 0:
            raise LinkLost("the cable is pulled")
        self._left -= 1
        self._made.frames += 1
        return Frame(self._number(), 0, 5.0, Status(0), np.zeros(CHANNELS, np.uint16), 0)

    def write(self, pressure_pa: Pressures, lifetime_s: float) -> None:
        """See Board.write."""
        if self._writes:
            self._left = 0
        if self._left <= 0:
            raise LinkLost("the cable is pulled")
        self._made.written += 1

    def close(self) -> None:
        """See Board.close."""
        self._left = 0


def random_failures(disconnects: int, seed: int) -> FaultResult:
    """A link whose board fails at random and cannot always be opened, under a clock of its own."""
    rng = np.random.default_rng([seed, 30])
    tally = Tally(FAMILY, "link that fails at random", seed)
    now_s, count = 0.0, 0

    def number() -> int:
        nonlocal count
        count += 1
        return count

    def open_board() -> Board:
        if rng.random() < 0.3:
            raise BoardError("no such port")
        return FailingBoard(rng, number)

    link = Link(open_board, lambda: now_s)
    last, down_s, given = 0, -1.0, 0
    while tally.cases < disconnects:
        now_s += 1.0 / RATE_HZ
        try:
            frame = link.read(0.0)
            written = link.write(np.zeros(VALVES), LIFETIME_S)
        except Exception as error:  # whatever it is, the acquisition thread would end
            tally.case(f"{type(error).__name__} at {now_s:.3f} s", False)
            continue
        given += frame is not None
        repeated = frame is not None and frame.sequence <= last
        last = frame.sequence if frame is not None else last
        if not link.up and down_s < 0.0:
            down_s = now_s
            tally.case("a frame is repeated", not repeated and not written)
        elif link.up:
            if 0.0 <= down_s < now_s - 40.0 * LONGEST_PAUSE_S:
                tally.case(f"down for {now_s - down_s:.1f} s", False)
            down_s = -1.0
    if link.counters.frames != given:
        tally.case(f"{link.counters.frames} frames counted, {given} given", False)
    link.close()
    return tally.result()


class NumberedPlant:
    """A plant whose first count is the number of its sample; it records what the valves receive."""

    def __init__(self) -> None:
        """Begin with sample 0."""
        self.count = 0
        self.pressure_pa = np.zeros(VALVES)

    def step(self, pressure_pa: Pressures) -> tuple[Counts, float, Status]:
        """See hand_sim.emulator.EmulatedPlant."""
        self.pressure_pa = np.array(pressure_pa)
        counts = np.full(CHANNELS, 20_000, np.uint16)
        counts[0] = 1_000 + self.count % 30_000
        self.count += 1
        return counts, 5.0, Status(0)


def emulated(
    kind: str,
    endpoint: Callable[[str], BoardEndpoint],
    open_board: Callable[[str], Board],
    disconnects: int,
    seed: int,
) -> list[FaultResult]:
    """The emulated board behind real bytes: it is disconnected for random times, in each of which its valves vent."""
    rng = np.random.default_rng([seed, 31])
    link, valves = Tally(FAMILY, f"{kind} link disconnected", seed), Tally(FAMILY, f"{kind} board without host", seed)
    with tempfile.TemporaryDirectory() as folder:
        rig = EmulatedLink(str(Path(folder) / "board"), endpoint, open_board)
        try:
            rig.until(lambda: rig.frames > 3, 5.0)
            for _ in range(disconnects):
                rig.cycle(link, valves, float(rng.uniform(0.13, 0.3)), float(rng.uniform(0.02, 0.1)))
        finally:
            rig.close()
    return [link.result(), valves.result()]


class EmulatedLink:
    """An emulated board and the driver's link, stepped by the frame."""

    def __init__(
        self,
        path: str,
        endpoint: Callable[[str], BoardEndpoint],
        open_board: Callable[[str], Board],
        stall_s: float = STALL_S,
    ) -> None:
        """Connect them through path; stall_s: longest wait [s] for a frame while frames flow."""
        self._stall_s = stall_s
        self.plant = NumberedPlant()
        self.emulator = Emulator(self.plant, lambda: endpoint(path), RATE_HZ, VALVES)
        self.link = Link(lambda: open_board(path), lambda: self.now_s)
        self.now_s = 0.0
        self.frames = 0
        self.repeated = False
        self._tick = 0
        self._last = -1
        self._flowing = False

    def step(self) -> None:
        """One frame of the board, and what the driver reads and writes in its time."""
        self._tick += 1
        self.now_s = self._tick / RATE_HZ
        self.emulator.tick(self._tick)
        frame = self.link.read(self._stall_s if self._flowing else GLANCE_S)
        self._flowing = frame is not None
        while frame is not None:  # all that have arrived, as the driver does: none stays in the queue of the port
            self.repeated |= frame.sequence <= self._last
            self._last = frame.sequence
            self.frames += 1
            self.received(frame)
            frame = self.link.read(GLANCE_S)
        pressure_pa = np.full(VALVES, PRESSURE_PA)
        self.written(self.link.write(pressure_pa, LIFETIME_S), pressure_pa)

    def received(self, frame: Frame) -> None:
        """A new frame has arrived."""

    def written(self, written: bool, pressure_pa: Pressures) -> None:
        """Set-points (valves,) [Pa] were sent, or could not be."""

    def until(self, reached: Callable[[], bool], seconds: float) -> float:
        """Step until a condition holds; the time it took [s], infinite where it did not come."""
        begun_s = self.now_s
        while not reached():
            if self.now_s - begun_s > seconds:
                return float("inf")
            self.step()
        return self.now_s - begun_s

    def cycle(self, link: Tally, valves: Tally, outage_s: float, good_s: float) -> None:
        """Disconnect for outage_s [s], come back, and go on for good_s [s]."""
        begun_s = self.now_s
        self.emulator.unplug(outage_s)
        down_s = self.until(lambda: not self.link.up, 1.0)
        self.until(lambda: not self.plant.pressure_pa.any(), 2.0)
        vented_s = self.now_s - begun_s
        valves.case(f"vented after {vented_s:.3f} s", vented_s <= LIFETIME_S + NEAR_S, vented_s)
        begun = self.frames
        back_s = self.until(lambda: self.frames > begun, outage_s + 2.0 * LONGEST_PAUSE_S)
        end_s = self.now_s + good_s
        self.until(lambda: self.now_s >= end_s, good_s + 1.0)
        handled = down_s < NEAR_S + 0.5 / RATE_HZ and back_s < float("inf") and not self.repeated
        name = f"down after {down_s:.3f} s, back after {back_s:.3f} s"
        link.case(name + (", a frame was repeated" if self.repeated else ""), handled, down_s)
        self.repeated = False

    def close(self) -> None:
        """Release the port."""
        self.link.close()
        self.emulator.close()
