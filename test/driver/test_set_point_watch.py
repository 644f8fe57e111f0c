"""A board that does not follow is found, in virtual time; a board that follows is never accused."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from hand_driver.board import Counts, Echo, Frame, Pressures, Status
from hand_driver.pressure_ramp import RAMP_PA_PER_S, PressureRamp
from hand_driver.set_point_watch import DEAF_S, SHOWN_S, SetPointWatch
from hand_driver.set_points import MAX_LIFETIME_S
from hand_driver.wire import SamplePayload, SetPointPayload
from hand_sim.emulator import BoardEndpoint, Emulator
from hand_sim.faults import Faults

JOINTS = ("thumb", "index", "middle")
VALVES = len(JOINTS)
RATE_HZ = 200.0


class Plant:
    """A plant whose counts are the set-points that act on it."""

    def step(self, pressure_pa: Pressures) -> tuple[Counts, float, Status]:
        return (pressure_pa * 1e-3).astype(np.uint16), 5.0, Status(0)


class Pipe(BoardEndpoint):
    """A link that hands over what it is given, with a version."""

    def __init__(self, version: int) -> None:
        self.version = version
        self.to_board: list[SetPointPayload] = []
        self.frames: list[SamplePayload] = []

    @property
    def description(self) -> str:
        return "pipe"

    def send(self, sample: SamplePayload, corrupt: bool = False) -> None:
        self.frames.append(sample)

    def receive(self) -> list[SetPointPayload]:
        arrived, self.to_board = self.to_board, []
        return arrived

    def close(self) -> None:
        return


def run(
    faults: Faults,
    version: int = 2,
    seconds: float = 3.0,
    command: Callable[[float], Pressures] | None = None,
) -> tuple[str, float]:
    """The first fault and its time [s]. Set-points follow each frame."""
    pipe = Pipe(version)
    emulator = Emulator(Plant(), lambda: pipe, RATE_HZ, VALVES, faults, seed=3)
    watch = SetPointWatch(JOINTS)
    for sequence, tick in enumerate(range(1, round(seconds * RATE_HZ) + 1)):
        emulator.tick(tick)
        now_s = tick / RATE_HZ
        sample = pipe.frames.pop(0)
        echo = sample.echo if version > 1 else None
        frame = Frame(
            sample.sequence, sample.board_time_us, 5.0, sample.status, sample.counts, round(now_s * 1e9), echo
        )
        fault = watch.frame(frame, round(now_s * 1e9))
        if fault:
            return fault, now_s
        pressure_pa = np.full(VALVES, 1e5) if command is None else command(now_s)
        pipe.to_board.append(SetPointPayload(sequence, 0.1, pressure_pa, 1 if version > 1 else None))
        watch.sent(sequence, pressure_pa, 0.1, round(now_s * 1e9) + 400_000)
    return "", seconds


def moving(time_s: float) -> Pressures:
    return np.array([1e5 + 1e5 * math.sin(7.0 * time_s + valve) for valve in range(VALVES)])


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("command", [None, moving, lambda _: np.zeros(VALVES)])
def test_a_board_that_follows_is_not_accused(version: int, command: Callable[[float], Pressures] | None) -> None:
    """Fails when a healthy board is vented: with pressure, without, in motion, with a few lost packets and frames."""
    assert run(Faults(), version, 60.0, command) == ("", 60.0)


def test_a_few_lost_packets_do_not_vent() -> None:
    """Fails when a line that loses 5 % of the set-points, or a few frames, counts as a deaf board."""
    assert run(Faults(lose=0.05), 2, 60.0, moving)[0] == ""


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("pressure_pa", [0.0, 2e5])
def test_a_board_that_takes_nothing_is_found(version: int, pressure_pa: float) -> None:
    """Fails when a deaf board is not found within 0.23 s of the first set-points, at rest as under pressure."""
    fault, at_s = run(Faults(deaf=((0.0, 99.0),)), version, command=lambda _: np.full(VALVES, pressure_pa))
    assert "takes no set-points" in fault
    assert DEAF_S + SHOWN_S < at_s < DEAF_S + SHOWN_S + 0.03


@pytest.mark.parametrize(("version", "longest_s"), [(1, 0.34), (2, 0.24)])
def test_a_board_that_goes_deaf_is_found(version: int, longest_s: float) -> None:
    """Fails when a board that stops to take set-points is found late; version 1 shows it after their lifetime."""
    fault, at_s = run(Faults(deaf=((1.0, 99.0),)), version, command=moving)
    assert "takes no set-points" in fault
    assert 1.0 < at_s < 1.0 + longest_s


@pytest.mark.parametrize("valve", range(VALVES))
def test_a_deaf_valve_is_named(valve: int) -> None:
    """Fails when one valve that does not follow stays hidden behind the others, or another joint is named."""
    fault, at_s = run(Faults(deaf_valves=(valve,)), command=moving)
    assert fault.startswith(f"{JOINTS[valve]}: the board holds 0.00 bar at valve {valve}")
    assert at_s < 0.05


@pytest.mark.parametrize("lose", [0.35, 0.5, 0.9])
def test_a_board_that_takes_some_packets_only_is_found(lose: float) -> None:
    """Fails when a board drives the hand with a part of its set-points."""
    fault, at_s = run(Faults(lose=lose), command=moving)
    assert "takes over only" in fault or "takes no set-points" in fault
    assert at_s < 1.0


def watched(echo: Echo, status: Status, age_s: float = 0.01) -> str:
    """The fault after set-points of 1 bar and this echo in five frames."""
    watch = SetPointWatch(JOINTS)
    watch.sent(7, np.full(VALVES, 1e5), 0.1, 0)
    frames = [Frame(k, k, 5.0, status, np.zeros(1, np.uint16), 0, echo) for k in range(5)]
    return [watch.frame(frame, round((age_s + 0.001 * k) * 1e9)) for k, frame in enumerate(frames)][-1]


def test_an_actuator_that_the_board_vents_by_itself_is_no_deaf_valve() -> None:
    """Fails when the protection of the board against over-pressure looks like a valve that does not follow."""
    echo = Echo(7, 0.01, np.array([0.0, 1e5, 1e5]), 1)
    assert watched(echo, Status.OVER_PRESSURE) == ""
    assert watched(echo, Status(0)).startswith("thumb: the board holds 0.00 bar at valve 0, where 1.00 bar was sent")


def test_pressure_beyond_its_lifetime_is_found() -> None:
    """Fails when a board whose watchdog does not vent passes."""
    held = np.full(VALVES, 1e5)
    assert watched(Echo(7, 0.14, held, 1), Status(0), 0.14) == ""
    assert "watchdog does not work" in watched(Echo(7, 0.16, held, 1), Status(0), 0.16)


def test_another_number_of_valves_is_named() -> None:
    """Fails when a board with other valves is driven, or the comparison raises."""
    assert "drives 2 valves, the description has 3" in watched(Echo(7, 0.01, np.zeros(2), 1), Status(0))


def test_an_echo_of_unknown_set_points_is_no_fault() -> None:
    """Fails when the echo of a former driver's set-points counts as a fault."""
    assert watched(Echo(12345, 0.01, np.full(VALVES, 3e5), 1), Status(0)) == ""


def echoed(echo: Callable[[int], Echo], send: bool, seconds: float = 2.0) -> tuple[str, float]:
    """The first fault and its time [s] after a reset, of a board with this echo. send: set-points are sent."""
    watch = SetPointWatch(JOINTS)
    watch.sent(7, np.full(VALVES, 1e5), 0.1, 0)
    watch.forget()
    for k in range(round(seconds * RATE_HZ)):
        now_ns = round(k / RATE_HZ * 1e9)
        if send:
            watch.sent(8 + k, np.full(VALVES, 1e5), 0.1, now_ns)
        frame = Frame(k, k, 5.0, Status(0), np.zeros(1, np.uint16), now_ns + 400_000, echo(k))
        if fault := watch.frame(frame, now_ns + 400_000):
            return fault, now_ns * 1e-9
    return "", seconds


@pytest.mark.parametrize("step", [0, 1, 40_503], ids=["the same", "counting", "jumping"])
@pytest.mark.parametrize("bar", [0.0, 1.0])
def test_a_board_that_echoes_what_was_never_sent_is_found_after_a_reset(step: int, bar: float) -> None:
    """Fails when the echo of sequences that were never sent passes: the board then follows another sender."""
    held = np.full(VALVES, bar * 1e5)
    fault, at_s = echoed(lambda k: Echo((1_000_000 + step * k) % 2**32, 0.005, held, k % 256), send=True)
    assert "this driver did not send" in fault and f"up to {bar:.2f} bar" in fault
    assert DEAF_S + SHOWN_S <= at_s < DEAF_S + SHOWN_S + 0.03


def test_pressure_that_nobody_here_asked_for_is_found_at_rest() -> None:
    """Fails when another host may hold the hand under pressure while this driver sends nothing."""
    fault, at_s = echoed(lambda k: Echo(1_000_000 + k, 0.005, np.full(VALVES, 1e5), k % 256), send=False)
    assert "this driver did not send" in fault
    assert MAX_LIFETIME_S < at_s < MAX_LIFETIME_S + 0.1
    assert echoed(lambda k: Echo(1_000_000 + k, 0.005, np.zeros(VALVES), k % 256), send=False)[0] == ""


def test_frames_that_arrive_all_at_once_accuse_no_board() -> None:
    """Fails when a board or a link that stood still for a moment, and then sends what it has, counts as deaf."""
    watch = SetPointWatch(JOINTS)
    for k in range(100):
        watch.sent(k, np.full(VALVES, 1e5), 0.1, k * 5_000_000)
    echo = Echo(0, 0.1, np.zeros(VALVES), 1)
    for k in range(30, 100):
        frame = Frame(k, k, 5.0, Status.VENTED, np.zeros(1, np.uint16), 500_000_000 + k * 1_000_000, echo)
        assert watch.frame(frame, k * 5_000_000) == ""


def test_after_a_vent_pressure_returns_along_the_ramp() -> None:
    """Fails when a set-point above what is measured passes at once, a lower one is held up, or the ramp never ends."""
    ramp = PressureRamp(2)
    assert ramp.limit(np.array([3e5, 0.0]), 0).tolist() == [0.0, 0.0]  # before the first frame
    ramp.frame(True, np.array([1e5, np.nan]), 1_000_000_000)
    assert ramp.limit(np.array([3e5, 3e5]), 1_000_000_000).tolist() == [1e5, 0.0]
    ramp.frame(True, np.array([0.5e5, -2e3]), 2_000_000_000)
    assert ramp.limit(np.array([3e5, 3e5]), 2_000_000_000).tolist() == [0.5e5, 0.0]
    ramp.frame(False, np.array([0.5e5, 0.0]), 2_005_000_000)
    later = ramp.limit(np.array([3e5, 1e3]), 2_500_000_000)
    assert later == pytest.approx([0.5e5 + 0.5 * RAMP_PA_PER_S, 1e3])
    assert ramp.active
    assert ramp.limit(np.array([3e5, 3e5]), 4_000_000_000).tolist() == [3e5, 3e5]
    assert not ramp.active
    assert ramp.limit(np.array([6e5, 6e5]), 4_000_000_000).tolist() == [6e5, 6e5]


def test_a_vented_board_keeps_the_ramp_at_what_is_measured() -> None:
    """Fails when the allowance grows, or the ramp ends, while the board is still vented."""
    ramp = PressureRamp(1)
    for k in range(400):
        ramp.frame(True, np.array([1e4]), k * 5_000_000)
        assert ramp.limit(np.array([5e5]), k * 5_000_000 + 400_000)[0] < 1.02e4
        assert ramp.limit(np.array([0.0]), k * 5_000_000 + 400_000)[0] == 0.0
    assert ramp.active


def test_a_new_connection_begins_a_ramp() -> None:
    """Fails when full pressure arrives at once after a cable was plugged in again."""
    ramp = PressureRamp(1)
    ramp.frame(False, np.array([2e5]), 0)
    assert ramp.limit(np.array([2e5]), 0)[0] == 2e5 and not ramp.active
    ramp.begin()
    assert ramp.limit(np.array([5e5]), 10)[0] == 0.0
    ramp.frame(False, np.array([2e5]), 1_000_000_000)
    assert ramp.limit(np.array([5e5]), 1_100_000_000)[0] == pytest.approx(2e5 + 0.1 * RAMP_PA_PER_S)
