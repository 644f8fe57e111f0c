"""The driver node within the test's process, on a simulated board: what passes around a latch, and without frames."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from std_srvs.srv import Trigger

from hand_driver.board import Board, Frame, Pressures
from hand_driver.guard import Guard
from hand_driver.node import DriverNode
from hand_driver.set_points import SetPoints
from hand_messages.cdr import Layout
from hand_messages.layouts import VALVE_COMMAND
from hand_model.description import Hand
from hand_sim.board import SimulatedBoard
from hand_sim.plant import SimulatedPlant

DRIVE_PA = 1e5


class RecordedBoard(SimulatedBoard):
    """A simulated board that keeps what is written to it: time [s] and largest set-point [Pa]."""

    def __init__(self, hand: Hand) -> None:
        super().__init__(SimulatedPlant(hand, hand.rate_hz, 1), hand.rate_hz)
        self.writes: list[tuple[float, float]] = []
        self.mute = False

    def read(self, timeout_s: float) -> Frame | None:
        frame = super().read(timeout_s)
        return None if self.mute else frame

    def write(self, pressure_pa: Pressures, lifetime_s: float) -> int:
        self.writes.append((time.monotonic(), float(np.max(pressure_pa))))
        return super().write(pressure_pa, lifetime_s)

    def since(self, at_s: float) -> list[float]:
        """What was written after at_s [s]."""
        return [pressure_pa for when_s, pressure_pa in self.writes if when_s > at_s]


class Driver(DriverNode):
    """The driver on such a board."""

    def board_factory(self, values: dict[str, Any], hand: Hand) -> Callable[[], Board]:
        self.board = RecordedBoard(hand)
        return lambda: self.board

    def command(self, pressure_pa: float, lifetime_s: float = 0.1) -> None:
        """Receive a valve command of one pressure for all valves."""
        assert self._hand is not None
        layout = Layout(VALVE_COMMAND, "hand", self._hand.joints)
        pressure = np.full(self._hand.valve_count, pressure_pa)
        lifetime_ns = round(lifetime_s * 1e9)
        self._on_command(layout.encode(self.now_ns(), lifetime_ns=lifetime_ns, pressure=pressure))

    def drive(self, seconds: float, pressure_pa: float = DRIVE_PA) -> None:
        """Command at 200 Hz, with the watch of the node in between."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            self.command(pressure_pa)
            self._on_watch()
            time.sleep(0.005)

    def until_driven(self) -> None:
        """Command until the ramp lets the whole pressure through."""
        end_s = time.monotonic() + 20.0
        while not self.board.writes or self.board.writes[-1][1] < DRIVE_PA:
            self.drive(0.05)
            if self._guard.fault.startswith("no measurement"):  # a busy machine let the acquisition wait
                self._on_reset(Trigger.Request(), Trigger.Response())
            assert time.monotonic() < end_s, (self._guard.fault, self.board.writes[-3:])


@pytest.fixture
def driver(tmp_path: Path) -> Iterator[Driver]:
    rclpy.init(args=["driver", "--ros-args", "-p", f"state_file:={tmp_path / 'state.json'}"])
    node = Driver()
    try:
        node.trigger_configure()
        node.trigger_activate()
        node.until_driven()
        yield node
    finally:
        node.finish()
        node.destroy_node()
        rclpy.try_shutdown()


class Racing(Guard):
    """A guard on which another thread trips the driver just after set-points were checked."""

    def __init__(self, trip: Callable[[], None]) -> None:
        super().__init__()
        self.thread = threading.Thread(target=trip)

    def refusal(self, set_points: SetPoints, objection: str = "") -> str:
        found = super().refusal(set_points, objection)
        self._race()
        return found

    def held(self, now_ns: int) -> SetPoints | None:
        found = super().held(now_ns)
        self._race()
        return found

    def _race(self) -> None:
        if self.thread.ident is None:
            self.thread.start()
            self.thread.join(0.3)  # with the lock it waits for the end of what is being written


@pytest.mark.parametrize("path", ["command", "hold"])
def test_no_pressure_follows_a_latch_of_another_thread(driver: Driver, path: str) -> None:
    """Fails when set-points that were checked before the acquisition thread trips are written after its vent."""
    guard = Racing(lambda: driver.trip("the board was restarted"))
    guard.written(SetPoints(np.full(len(driver._joints), DRIVE_PA), 1.0, 0), time.monotonic_ns())
    driver._guard = guard
    begun_s = time.monotonic()
    if path == "command":
        driver.command(DRIVE_PA)
    else:
        driver._follow_publishers(time.monotonic_ns(), "second publisher: of a test")
    guard.thread.join()
    assert driver.board.since(begun_s)[-1] == 0.0
    assert guard.fault == "the board was restarted" and not guard.driving(time.monotonic_ns())


class Defect:
    """Replaces a function by one that raises `times` times before it works."""

    def __init__(self, replaced: Callable[..., Any], times: int) -> None:
        self.replaced, self.left = replaced, times

    def __call__(self, *given: Any) -> Any:
        self.left -= 1
        if self.left >= 0:
            raise RuntimeError("defect\nof a test")
        return self.replaced(*given)


def until(condition: Callable[[], Any]) -> None:
    """Wait until the condition holds, at most 5 s."""
    end_s = time.monotonic() + 5.0
    while not condition():
        time.sleep(0.005)
        assert time.monotonic() < end_s


def test_a_defect_of_the_acquisition_vents_and_latches(
    driver: Driver, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Fails when an exception ends the acquisition, is not logged, or pressure passes before `reset_driver`."""
    monkeypatch.setattr(driver._topics, "encode", Defect(driver._topics.encode, 1))
    until(lambda: driver._guard.fault)
    begun_s, cycles = time.monotonic(), driver.cycles
    driver.drive(0.3)
    assert driver._guard.fault == "internal error: RuntimeError: defect of a test; see the log of the driver"
    assert set(driver.board.since(begun_s)) == {0.0}
    until(lambda: (driver.cycles or 0) > (cycles or 0) + 10)
    assert "Traceback" in capfd.readouterr().err
    assert driver._on_reset(Trigger.Request(), Trigger.Response()).success
    driver.until_driven()


def test_a_defect_of_writing_ends_no_acquisition(driver: Driver, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when the acquisition ends where the vent after a defect fails as well."""
    monkeypatch.setattr(driver._topics, "encode", Defect(driver._topics.encode, 1))
    monkeypatch.setattr(driver.board, "write", Defect(driver.board.write, 1))
    until(lambda: driver._guard.fault)
    cycles = driver.cycles or 0
    until(lambda: (driver.cycles or 0) > cycles + 10)
    driver.drive(0.1)
    assert driver.board.writes[-1][1] == 0.0


def test_a_silent_board_is_driven_no_further(driver: Driver) -> None:
    """Fails when pressure is written after a silence of 0.2 s, none is latched, or a longer lifetime delays it."""
    driver.command(DRIVE_PA, lifetime_s=1.0)
    driver.board.mute = True
    begun_s = time.monotonic()
    driver.drive(0.6)
    assert "no measurement for 0.1 s" in driver._guard.fault
    assert set(driver.board.since(begun_s + 0.25)) == {0.0}


def test_nothing_is_driven_before_the_first_measurement(driver: Driver) -> None:
    """Fails when a driver that has just been activated writes pressure although the board sends nothing."""
    driver.trigger_deactivate()
    driver.board.mute = True
    driver.board._closed = False
    driver.trigger_activate()
    begun_s = time.monotonic()
    driver.drive(0.3)
    assert max(driver.board.since(begun_s), default=0.0) == 0.0 and driver._guard.fault == ""
    commands = next(status for status in driver.health() if status.name == "commands")
    assert "nothing has been measured yet" in commands.message


def test_a_fault_of_a_frame_is_stored_when_the_driver_is_deactivated(driver: Driver, tmp_path: Path) -> None:
    """Fails when a driver that is deactivated before its next watch, and configured again, has lost its latch."""
    driver._trip("the board was restarted")
    driver.trigger_deactivate()
    assert "the board was restarted" in (tmp_path / "state.json").read_text(encoding="utf-8")
    driver.trigger_cleanup()
    driver.trigger_configure()
    assert driver._guard.fault.startswith("the board was restarted (latched ")
