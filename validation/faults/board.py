"""Faults of the board itself: repeated frames, a wrong clock, a restart; and, as processes, a board that hears nothing.

In virtual time the emulated board sends old frames again over real bytes, and the mapping of its clock gets drifts,
steps and restarts. With --full an emulated board in motion becomes deaf, half deaf or mute, restarts, reports
over-pressure or loses its supply; the controller must vent and latch.
"""

from __future__ import annotations

import signal
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from hand_driver.board import Board, Frame, Pressures
from hand_driver.board_clock import BoardClock
from hand_driver.board_health import clock_health
from hand_driver.set_point_watch import SetPointWatch
from hand_driver.wire import SamplePayload
from hand_messages.health import Level
from hand_sim.can_endpoint import SlcanEndpoint
from hand_sim.emulator import BoardEndpoint, Emulator
from hand_sim.faults import Faults
from hand_sim.serial_endpoint import SerialEndpoint
from validation.faults.disconnects import LIFETIME_S, RATE_HZ, VALVES, EmulatedLink, can_board, serial_board
from validation.faults.result import FaultResult, Size, Tally

FAMILY = "board"
REPLAY_SHARE = 0.5
"""Share of the frames after which an earlier one is sent again."""
STALL_S = 2.0
"""Real time for which a read may wait for a frame that was sent: the machine may stall."""
REACTION_S = 0.5
"""A board that takes no set-points must be noticed in motion within this time."""
NOT_FOLLOWING = {
    "takes no set-points": (Faults(deaf=((1.0, 9.0),)), 1.0),
    "takes half of the set-points": (Faults(lose=0.5), 0.0),
    "holds one valve at 0 Pa": (Faults(deaf_valves=(3,)), 0.0),
    "restarts": (Faults(restart=(1.0,)), 1.0),
}
"""Faults of a board by name, each with the time at which it begins [s]. A board that restarts is vented at once."""
BOARD_FAULTS = ("deaf", "half_deaf", "mute", "restarted", "over_pressure", "supply_lost")


def run(size: Size, seed: int) -> list[FaultResult]:
    """Replays on both transports and clocks; FULL: also the faults of BOARD_FAULTS on processes."""
    frames = size.of(300, 10_000)
    found = [
        replays("serial", SerialEndpoint, serial_board, frames, seed),
        replays("CAN", SlcanEndpoint, can_board, frames, seed),
        clocks(size.of(20, 500), seed),
        wrong_rates(size.of(4, 100), seed),
    ]
    found += [watched(name, faults, begin_s, size.of(2, 40), seed) for name, (faults, begin_s) in NOT_FOLLOWING.items()]
    return found + (processes(3, seed) if size is Size.FULL else [])


class WatchedLink(EmulatedLink):
    """An emulated board whose frames and set-points the driver's watch compares; the time is that of the board."""

    def __init__(self, path: str, faults: Faults, seed: int) -> None:
        """Connect them; the board has faults."""
        super().__init__(path, SerialEndpoint, serial_board, STALL_S)
        self.emulator.close()
        self.emulator = Emulator(self.plant, lambda: SerialEndpoint(path), RATE_HZ, VALVES, faults, seed=seed)
        self.watch = SetPointWatch([f"valve {number}" for number in range(VALVES)])
        self.fault = ""
        self.asked_since_s = -1.0
        self._pace_from_s = min(faults.restart, default=float("inf")) - 0.02

    def step(self) -> None:
        """One frame; a restart is recognised by the time of receipt, so that frames then keep the rate of the board."""
        if self.now_s > self._pace_from_s:
            time.sleep(1.0 / RATE_HZ)
        super().step()

    def written(self, written: bool, pressure_pa: Pressures) -> None:
        """See EmulatedLink.written."""
        if written:
            self.watch.sent(self.link.sequence, pressure_pa, LIFETIME_S, round(self.now_s * 1e9))
            self.asked_since_s = self.now_s if self.asked_since_s < 0.0 else self.asked_since_s

    def received(self, frame: Frame) -> None:
        """See EmulatedLink.received."""
        now_ns = round(self.now_s * 1e9)
        fault = self.watch.frame(replace(frame, received_ns=now_ns), now_ns)
        if self.link.counters.restarts:
            fault = "restarted"
        self.fault = self.fault or fault


def watched(name: str, faults: Faults, begin_s: float, repeats: int, seed: int) -> FaultResult:
    """A board that does not follow its set-points from begin_s [s] on, found by the driver from its frames."""
    tally = Tally(FAMILY, f"board {name}", seed)
    for number in range(repeats):
        with tempfile.TemporaryDirectory() as folder:
            rig = WatchedLink(str(Path(folder) / "board"), faults, seed + number)
            try:
                rig.until(lambda rig=rig: bool(rig.fault), 4.0)  # type: ignore[misc]
                took_s = rig.now_s - max(begin_s, rig.asked_since_s)
                tally.case(
                    f"{number}: {rig.fault or 'not found'}",
                    bool(rig.fault) and 0.0 <= took_s <= REACTION_S,
                    took_s,
                )
            finally:
                rig.close()
    return tally.result()


class Replaying:
    """Makes endpoints that send earlier samples again."""

    def __init__(self, rng: np.random.Generator, endpoint: Callable[[str], BoardEndpoint]) -> None:
        """Replay at random."""
        self._rng = rng
        self._endpoint = endpoint
        self._past: deque[SamplePayload] = deque(maxlen=50)
        self.replayed = 0

    def __call__(self, path: str) -> BoardEndpoint:
        """Open an endpoint whose send is followed by replays."""
        made = self._endpoint(path)
        send = made.send

        def sending(sample: SamplePayload, corrupt: bool = False) -> None:
            send(sample, corrupt)
            self._past.append(sample)
            if self._rng.random() < REPLAY_SHARE:
                send(self._past[int(self._rng.integers(len(self._past)))])
                self.replayed += 1

        made.send = sending  # type: ignore[method-assign]
        return made


def replays(
    kind: str, endpoint: Callable[[str], BoardEndpoint], open_board: Callable[[str], Board], frames: int, seed: int
) -> FaultResult:
    """Earlier frames are sent again: none of them may be handed over as a new one."""
    rng = np.random.default_rng([seed, 50])
    tally = Tally(FAMILY, f"frame sent again, {kind}", seed)
    replaying = Replaying(rng, endpoint)
    with tempfile.TemporaryDirectory() as folder:
        rig = EmulatedLink(str(Path(folder) / "board"), replaying, open_board, STALL_S)
        try:
            rig.until(lambda: rig.frames > 3, 5.0)
            wrong = 0
            for _ in range(frames):
                rig.step()
                wrong += rig.repeated
                rig.repeated = False
        finally:
            rig.close()
    sent = max(replaying.replayed, wrong)
    tally.false_accepts = wrong
    tally.many(sent, sent - wrong)
    if rig.frames < 0.9 * frames:
        tally.case(f"only {rig.frames} of {frames} new frames were handed over", False)
    return tally.result()


def clocks(cases: int, seed: int) -> FaultResult:
    """Boards with drift, steps and restarts of their clock, and random delays: stamps rise and are never ahead."""
    rng = np.random.default_rng([seed, 51])
    tally = Tally(FAMILY, "clock of the board drifts, steps or restarts", seed, "ms of age")
    for case in range(cases):
        drift = float(rng.choice([0.0, 1e-4, -1e-4, 1e-2, -1e-2]))
        clock = BoardClock()
        board_us, host_ns, last, worst_ns, fault = float(rng.integers(1 << 40)), 1_000_000_000, -1, 0, ""
        for _ in range(4_000):
            host_ns += 5_000_000
            board_us += 5_000.0 * (1.0 + drift)
            if rng.random() < 0.001:
                board_us = float(rng.choice([0.0, board_us + 2e6, max(board_us - 3e6, 0.0), 1e15]))
            received_ns = host_ns + int(rng.exponential(300_000))
            stamp_ns = clock.map(int(board_us), received_ns)
            fault = fault or ("" if stamp_ns > last else "goes back")
            fault = fault or ("" if stamp_ns <= received_ns + 1000 else "is ahead of its receipt")
            last, worst_ns = stamp_ns, max(worst_ns, received_ns - stamp_ns)
        tally.case(f"case {case}, drift {drift:g}: a stamp {fault}", not fault, None, worst_ns * 1e-6)
    return tally.result()


def wrong_rates(cases: int, seed: int) -> FaultResult:
    """A board whose clock is 1 % fast or slow, with random delays: it is named, and its stamps keep up."""
    rng = np.random.default_rng([seed, 53])
    tally = Tally(FAMILY, "clock of the board 1 % off", seed, "ms of age")
    for case in range(cases):
        error = (0.01, -0.01)[case % 2]
        clock = BoardClock()
        board_us, host_ns, worst_ns, named_s = float(rng.integers(1 << 40)), 1_000_000_000, 0, -1.0
        for number in range(6_000):
            host_ns += 5_000_000
            board_us += 5_000.0 * (1.0 + error)
            received_ns = host_ns + int(rng.exponential(300_000))
            worst_ns = max(worst_ns, received_ns - clock.map(int(board_us), received_ns))
            if named_s < 0.0 and clock_health(clock.rate_error, clock.lag_s, 0.0).level != Level.OK:
                named_s = number * 0.005
        tally.case(f"{error:+.0%}: not named", named_s >= 0.0, named_s, worst_ns * 1e-6)
    return tally.result()


def processes(repeats: int, seed: int) -> list[FaultResult]:
    """An emulated board on a pseudo-terminal gets a fault in motion: the controller vents and latches."""
    from validation.faults.live import Nodes, TooLateError, User  # noqa: PLC0415 - needs ROS

    rng = np.random.default_rng([seed, 52])
    found = []
    for fault in BOARD_FAULTS:
        tally = Tally(FAMILY, f"board {fault.replace('_', ' ')}", seed, "Pa", real_time=True)
        with tempfile.TemporaryDirectory() as folder, Nodes(Path(folder)) as nodes:
            user = User()
            try:
                path = Path(folder) / "port"
                module = "validation.faults.faulty_board"
                nodes.start("board", [sys.executable, "-m", module, str(path), fault, "--seed", str(seed)])
                user.until(lambda nodes=nodes: "ready" in nodes.log("board"), "the board is not ready")  # type: ignore[misc]
                nodes.node("driver", transport="serial", serial_port=path)
                nodes.node("controller")
                for number in range(repeats):
                    user.drive()
                    user.spin(float(rng.uniform(0.1, 0.8)))
                    user.worst_pa = 0.0
                    at_s = time.monotonic()
                    nodes.send("board", signal.SIGUSR1)
                    user.motion()
                    took_s = user.until_vented(at_s)
                    user.until_latched()
                    nodes.send("board", signal.SIGUSR2)
                    user.spin(1.0)
                    again = user.commanded_pa > 0.0
                    tally.case(f"{number}: {took_s:.2f} s", took_s <= REACTION_S and not again, took_s, user.worst_pa)
            except TooLateError as error:
                tally.case(str(error), False, None, user.worst_pa)
            finally:
                user.close()
        found.append(tally.result())
    return found
