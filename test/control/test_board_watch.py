"""What the controller watches of the board, and the ramp after arming."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_control.arming_ramp import END_S, RAMP_PA_PER_S, ArmingRamp
from hand_control.board_watch import LOST_S, OVER_PRESSURE, VENTED, VENTED_S, BoardWatch
from hand_control.controller import Controller, Times
from hand_control.declared import Settings
from hand_control.supervisor import Phase
from hand_driver.board import Frame
from hand_driver.measurement import Converter
from hand_messages.health import Level
from hand_model.description import load_hand
from hand_sim.plant import SimulatedPlant

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
COUNT = len(HAND.joints)
REPORT_NS, CHECK_NS = 50_000_000, 20_000_000


def run(
    seconds: float, status: int = 0, fault: str = "", asking: bool = True, reports: bool = True
) -> tuple[str, float]:
    """The first fault and its time [s], with a healthy second before, then reports with this content or none."""
    watch = BoardWatch()
    for now_ns in range(0, round((1.0 + seconds) * 1e9), 10_000_000):
        began = now_ns >= 1_000_000_000
        if now_ns % REPORT_NS == 0 and (reports or not began):
            watch.state(status if began else 0, 2, fault if began else "", now_ns)
        line = watch.check(asking, now_ns) if now_ns % CHECK_NS == 0 else ""
        if line:
            return line, now_ns * 1e-9 - 1.0
    return "", seconds


def test_a_healthy_board_is_left_alone() -> None:
    """Fails when reports at 20 Hz trip the controller, or a vented board does while no pressure is asked for."""
    assert run(60.0) == ("", 60.0)
    assert run(60.0, status=VENTED, asking=False) == ("", 60.0)


@pytest.mark.parametrize(
    ("what", "line", "low_s", "high_s"),
    [
        ({"status": OVER_PRESSURE}, "above its pressure limit", 0.0, 0.02),
        ({"fault": "index_distal: deaf"}, "index_distal: deaf; call reset_driver", 0.0, 0.02),
        ({"status": VENTED}, "vented, although pressure was asked for", VENTED_S, VENTED_S + 0.07),
        ({"reports": False}, "no board_state for", LOST_S - 0.05, LOST_S + 0.02),
    ],
)
def test_each_fault_of_the_board_is_found(what: dict[str, object], line: str, low_s: float, high_s: float) -> None:
    """Fails when a fault of the board does not reach the controller, or later than promised."""
    said, at_s = run(5.0, **what)  # type: ignore[arg-type]
    assert line in said
    assert low_s <= at_s <= high_s


def test_without_any_report_the_board_is_not_watched_and_that_is_said() -> None:
    """Fails when a driver without the topic cannot be used, or the missing watch is not shown."""
    watch = BoardWatch()
    assert watch.check(True, 10**12) == ""
    assert watch.health().level == Level.WARN
    watch.state(0, 1, "", 0)
    assert "watched less" in watch.health().message
    watch.state(0, 2, "", 0)
    assert watch.health().level == Level.OK


def test_a_board_that_is_vented_in_turns_is_no_deaf_board() -> None:
    """Fails when short vents, as after an outage, add up."""
    watch = BoardWatch()
    for now_ns in range(0, 10**10, 50_000_000):
        watch.state(VENTED if now_ns % 400_000_000 < 200_000_000 else 0, 2, "", now_ns)
        assert watch.check(True, now_ns) == ""


def armed(pressure_pa: float) -> tuple[Controller, list[np.ndarray]]:
    """A controller that arms with the hand at 45 degrees, and its commands of 1 s; the hand does not move."""
    controller = Controller(HAND, Settings.of(HAND, {"enabled_at_start": True}))
    controller.enable(True)
    position, zero = np.full(COUNT, 0.8), np.zeros(COUNT)
    commands = []
    for k in range(1, 201):
        now_ns = k * 5_000_000
        tick = controller.frame(Times(now_ns, now_ns, now_ns), position, zero, np.full(COUNT, pressure_pa))
        assert tick is not None
        commands.append(tick.pressure_command.copy())
    return controller, commands


@pytest.mark.parametrize("pressure_pa", [0.0, 5e4])
def test_after_enabling_pressure_rises_along_the_ramp(pressure_pa: float) -> None:
    """Fails when a hand that is enabled in a pose that needs pressure gets it at once."""
    _, commands = armed(pressure_pa)
    assert commands[0].max() <= pressure_pa + RAMP_PA_PER_S * 0.005 + 1.0
    rise = np.diff(commands[1:], axis=0).max()
    assert rise <= RAMP_PA_PER_S * 0.005 + 1.0
    assert commands[-1].max() > pressure_pa + 1e4


def test_the_ramp_lets_lower_set_points_pass_and_ends() -> None:
    """Fails when a hand cannot be relieved during the ramp, or is limited for ever."""
    ramp = ArmingRamp()
    ramp.start(np.array([1e5, np.nan]))
    command = np.array([3e5, 0.0])
    ramp.limit(command, 0.01)
    assert command == pytest.approx([1e5 + 0.01 * RAMP_PA_PER_S, 0.0])
    assert ramp.active
    for _ in range(round(END_S / 0.01)):
        assert ramp.active
        command = np.array([0.0, 0.0])
        ramp.limit(command, 0.01)
        assert command.tolist() == [0.0, 0.0]
    assert not ramp.active
    command = np.array([6e5, 6e5])
    ramp.limit(command, 0.01)
    assert command.tolist() == [6e5, 6e5]


def test_while_the_board_is_vented_the_ramp_begins_again() -> None:
    """Fails when pressure is asked for at once, or an integrator runs, although the driver lets it rise slowly."""
    controller, _ = armed(0.0)
    position, zero = np.full(COUNT, np.pi / 4), np.zeros(COUNT)
    highest = []
    for k in range(201, 301):
        now_ns = k * 5_000_000
        controller.board.state(VENTED if k < 250 else 0, 2, "", now_ns)
        tick = controller.frame(Times(now_ns, now_ns, now_ns), position, zero, zero)
        assert tick is not None
        highest.append(tick.pressure_command.max())
    assert max(highest[:49]) <= RAMP_PA_PER_S * 0.005 + 1.0
    assert np.diff(highest[49:]).max() <= RAMP_PA_PER_S * 0.005 + 1.0
    assert highest[-1] > 1e4


def test_a_fault_of_the_driver_trips_the_controller_and_forbids_enabling() -> None:
    """Fails when the controller drives on against a driver that holds the hand vented, or is enabled against it."""
    controller, _ = armed(0.0)
    now_ns = 10**9
    controller.board.state(0, 2, "the board was restarted", now_ns)
    assert controller.check(now_ns)
    assert controller.safety.phase is Phase.VENTED
    assert "the board was restarted; call reset_driver" in controller.safety.fault
    controller.reset()
    with pytest.raises(ValueError, match="the driver holds the hand vented"):
        controller.enable(True)
    controller.board.state(0, 2, "", now_ns)
    controller.enable(True)


@pytest.mark.parametrize(("lost", "reported"), [(0, True), (2, False), (4, False), (8, False)])
def test_a_board_that_vents_explains_pressures_that_fall(lost: int, reported: bool) -> None:
    """Fails when a board that gets no set-points for 0.15 s is taken for a broken pressure sensor.

    lost: frames that are missing when it vents.  reported: whether it says that it has.
    """
    plant = SimulatedPlant(HAND, 200.0, seed=3)
    controller = Controller(HAND, Settings.of(HAND, {}))
    controller.enable(True)
    converter = Converter(HAND, 0.01)
    asked, lowest = np.zeros(HAND.valve_count), np.inf
    for k in range(1, 601):
        now_ns, silent = k * 5_000_000, 400 <= k < 430
        counts, supply_v, status = plant.step(0.0 * asked if silent else asked)
        measured = converter.convert(Frame(k, now_ns // 1000, supply_v, status, counts, now_ns))
        lowest = min(lowest, float(measured.pressure.max())) if silent else lowest
        if 400 <= k < 400 + lost:
            continue
        controller.board.state(VENTED if silent and reported else 0, 2, "", now_ns)
        now = Times(now_ns, now_ns, now_ns)
        tick = controller.frame(now, measured.position, measured.velocity, measured.pressure)
        assert tick is not None
        asked = tick.pressure_command.copy()
        if k == 10:
            controller.command(Times(0, now_ns, now_ns), HAND.joints, [1.0] * COUNT, [])
    assert lowest < 5e4  # the pressures did fall
    assert controller.safety.fault == ""
    assert measured.position == pytest.approx(np.full(COUNT, 1.0), abs=0.02)


def test_a_board_that_says_it_vents_and_presses_on_is_found() -> None:
    """Fails when the report of a vented board excuses a pressure that stays."""
    controller, _ = armed(1.2e5)
    position, zero = np.full(COUNT, np.pi / 4), np.zeros(COUNT)
    for k in range(201, 301):
        now_ns = k * 5_000_000
        controller.board.state(VENTED, 2, "", now_ns)
        controller.frame(Times(now_ns, now_ns, now_ns), position, zero, np.full(COUNT, 1.2e5))
    assert controller.safety.phase is Phase.VENTED
    assert "pressure" in controller.safety.fault
