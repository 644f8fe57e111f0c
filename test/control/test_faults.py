"""Pressure faults, force sensors, trajectory tolerances and grasps in the composed controller, without ROS."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hand_control.controller import Controller, Times
from hand_control.declared import Settings
from hand_control.grasps import load_grasps
from hand_control.supervisor import Phase
from hand_messages.health import Level
from hand_model.description import load_hand
from hand_sim.plant import OMEGA, PHI, HandPlant, P
from validation.faults.sensors import Case, study

CONFIG = Path(__file__).parents[2] / "config"
HAND = load_hand(CONFIG / "hand.yaml")
COUNT = len(HAND.joints)
MS = 1_000_000
INDEX = HAND.joints.index("index_proximal")


class Rig:
    """A controller on a plant, with faults that a test may put between them."""

    def __init__(self, **values: Any) -> None:
        self.controller = Controller(HAND, Settings.of(HAND, values))
        self.plant = HandPlant(HAND, 0.005)
        self.now_ns = 0
        self.seen_pressure: Callable[[Any], Any] = lambda pressure: pressure
        self.valve: Callable[[Any], Any] = lambda command: command
        self.tick: Any = None
        self.controller.enable(True)
        self.run(0.2)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.005)):
            self.now_ns += 5 * MS
            state = self.plant.state
            pressure = self.seen_pressure(state[P].copy())
            times = Times(self.now_ns, self.now_ns, self.now_ns)
            self.tick = self.controller.frame(times, state[PHI], state[OMEGA], pressure)
            self.plant.advance(self.valve(self.tick.pressure_command.copy())[None])

    def command(self, **angles: float) -> None:
        self.controller.command(self.now(), list(angles), list(angles.values()), [])

    def now(self) -> Times:
        return Times(0, self.now_ns, self.now_ns)

    def health(self, name: str) -> Any:
        return next(h for h in self.controller.health(self.now_ns) if h.name == name)


def only(joint: int, change: Any) -> Any:
    def changed(values: Any) -> Any:
        values[joint] = change(values[joint])
        return values

    return changed


def test_over_pressure_vents_and_latches() -> None:
    """Fails when a pressure above the limit does not vent the hand at once and until a reset."""
    rig = Rig()
    rig.seen_pressure = only(INDEX, lambda _: 7.0e5)
    rig.run(0.1)
    assert rig.controller.safety.phase is Phase.VENTED
    fault = "index_proximal: its pressure (channel 14) is 7.00 bar, over-pressure beyond the limit of 6.00 bar; check"
    assert fault in rig.health("safety").message
    with pytest.raises(ValueError, match="reset first"):
        rig.controller.enable(True)


def test_a_valve_stuck_open_vents_and_latches() -> None:
    """Fails when the hand is driven on while a joint keeps its pressure against the command."""
    rig = Rig()
    rig.command(index_proximal=1.0)
    rig.run(2.0)
    held = rig.plant.state[P][INDEX]
    rig.valve = only(INDEX, lambda _: held)
    rig.command(index_proximal=0.0)
    rig.run(1.5)
    assert rig.controller.safety.phase is Phase.VENTED
    assert re.fullmatch(
        r"index_proximal: its pressure \(channel 14\) stays at \d\.\d\d bar, the valve does not follow; check .*",
        rig.controller.safety.fault,
    )


def test_a_vented_joint_that_stays_under_pressure_is_reported() -> None:
    """Fails when a valve that stays open after a vent is called fine, is latched, or is reported for ever."""
    rig = Rig()
    rig.command(index_proximal=1.0)
    rig.run(2.0)
    held = rig.plant.state[P][INDEX]
    rig.valve = only(INDEX, lambda _: held)
    rig.controller.vent("vent was called")
    rig.run(0.4)
    assert rig.health("valves").level == Level.OK
    rig.run(0.8)
    assert rig.health("valves").level == Level.ERROR
    line = (
        r"vented, but index_proximal: its pressure \(channel 14\) stays at \d\.\d\d bar, the valve does not follow; .*"
    )
    assert re.fullmatch(line, rig.health("valves").message)
    assert rig.controller.safety.fault == ""
    rig.valve = lambda command: command
    rig.run(1.0)
    assert rig.health("valves").level == Level.OK


def test_a_hand_that_is_vented_from_a_grasp_is_fine() -> None:
    """Fails when the pressure that leaves through a good valve is reported, or that of the motion before."""
    rig = Rig()
    rig.command(**dict.fromkeys(HAND.joints, 1.1))
    rig.run(2.0)
    rig.controller.vent("vent was called")
    for _ in range(300):
        rig.run(0.005)
        assert rig.health("valves").level == Level.OK, rig.health("valves").message
    rig.controller.enable(True)
    rig.run(0.5)
    assert rig.controller.safety.phase is Phase.ACTIVE and rig.health("valves").level == Level.OK


def test_a_starved_joint_is_warned_of_and_recovers() -> None:
    """Fails when a blocked valve is not reported, winds its integrator up, stops those of other joints, or vents."""
    rig = Rig()
    rig.valve = only(INDEX, lambda command: min(command, 2.0e4))
    rig.command(index_proximal=1.0, ring_proximal=1.0)
    rig.run(3.0)
    assert rig.controller.safety.phase is Phase.ACTIVE
    assert rig.health("valves").level == Level.WARN and "index_proximal" in rig.health("valves").message
    assert rig.tick.position[HAND.joints.index("ring_proximal")] == pytest.approx(1.0, abs=0.03)
    rig.valve = lambda command: command
    rig.run(3.0)
    assert rig.health("valves").level == Level.OK
    assert rig.tick.position[INDEX] == pytest.approx(1.0, abs=0.03)


def test_a_starved_joint_gets_no_more_than_its_pressure_justifies() -> None:
    """Fails when the set-point of a joint whose valve stays closed rises on."""
    rig = Rig()
    rig.valve = only(INDEX, lambda command: min(command, 2.0e4))
    rig.command(index_proximal=1.2)
    rig.run(2.0)
    assert rig.tick.pressure_command[INDEX] <= 2.0 * 2.0e4 + 3.0e4 + 3e3  # and the noise of the sensor


@pytest.mark.parametrize(("error", "joint"), [(0.0, 7), (0.1, 7), (0.3, 1)])
def test_a_valve_that_sticks_while_its_joint_falls_is_found(error: float, joint: int) -> None:
    """Fails when the motion of a falling joint, which can only raise a pressure, excuses one that is too low."""
    print("seed 117")
    found = study(HAND, [Case(error, "step back", joint, "valve stuck", False)], 117)[0]
    assert found.warned_s is not None
    assert found.warned_s < 0.3
    assert found.error_deg < 10.0


def test_force_sensors_report_contact_at_once_and_go_stale() -> None:
    """Fails when a force causes no contact, its event lacks force or source, or a silent sensor holds contact."""
    rig = Rig()
    force = np.zeros(len(HAND.sensors.sites))
    force[HAND.sensors.sites.index("index_proximal_pad")] = 2.0
    rig.controller.forces(rig.now_ns, force)
    rig.run(0.02)
    assert rig.tick.contact[INDEX] and rig.tick.contact.sum() == 1
    (event,) = rig.controller.contacts()
    assert event.joint == INDEX and event.touching and event.source == "force" and event.force_n == 2.0
    rig.run(0.3)
    assert not rig.tick.contact.any()
    assert [e.touching for e in rig.controller.contacts()] == [False]
    force[:] = math.nan
    rig.controller.forces(rig.now_ns, force)
    rig.run(0.02)
    assert not rig.tick.contact.any()


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"path_tolerance_deg": 5.0}, "is off the path by"),
        ({"goal_tolerance_deg": 5.0, "goal_time_s": 0.3}, "is not at the goal by"),
    ],
)
def test_trajectories_are_aborted_outside_their_tolerance(values: dict[str, float], line: str) -> None:
    """Fails when a joint that cannot follow is driven on, or the line does not name it and its error."""
    rig = Rig(**values)
    rig.valve = only(INDEX, lambda command: min(command, 2.0e4))
    points: list[tuple[float, list[float], list[float]]] = [(0.5, [1.0, 1.0], []), (1.0, [1.2, 1.2], [])]
    rig.controller.trajectory(rig.now(), ["index_proximal", "ring_proximal"], points)
    rig.run(3.0)
    message = rig.health("commands").message
    assert "index_proximal" in message and line in message and "hold their measured angle" in message
    assert abs(rig.tick.reference[INDEX] - rig.tick.position[INDEX]) < 0.15


def test_trajectories_within_their_tolerance_go_on() -> None:
    """Fails when a tolerance aborts a motion that the hand follows well."""
    rig = Rig(path_tolerance_deg=5.0, goal_tolerance_deg=2.0)
    rig.controller.trajectory(rig.now(), ["index_proximal"], [(0.8, [1.2], [])])
    rig.run(3.0)
    assert rig.health("commands").level == Level.OK
    assert rig.tick.position[INDEX] == pytest.approx(1.2, abs=0.02)


def test_a_grasp_of_nothing_ends_at_the_shape() -> None:
    """Fails when closing on nothing does not end, ends elsewhere, or claims contact."""
    rig = Rig()
    grasp = load_grasps(CONFIG / "grasps.yaml", HAND)["cylindrical"]
    rig.controller.grasp(grasp, 0.5, 0.1, rig.now_ns)
    rig.run(4.0)
    assert rig.controller.grasping is None and rig.controller.grasp_end == "done"
    assert not rig.controller.grasp_contact.any()
    assert np.degrees(np.abs(rig.tick.position - grasp.shape(0.5))).max() < 3.0
    with pytest.raises(ValueError, match=r"max_torque is 9 N m; the allowed range is 0 to 0\.6"):
        rig.controller.grasp(grasp, 0.5, 9.0, rig.now_ns)


def test_a_vent_ends_a_grasp_with_its_reason() -> None:
    """Fails when a grasp continues after a vent."""
    rig = Rig()
    grasp = load_grasps(CONFIG / "grasps.yaml", HAND)["hook"]
    rig.controller.grasp(grasp, 1.0, math.nan, rig.now_ns)
    rig.run(0.1)
    assert rig.controller.grasping is not None
    rig.controller.vent("vent was called")
    rig.run(0.02)
    assert rig.controller.grasping is None and "vent was called" in rig.controller.grasp_end
