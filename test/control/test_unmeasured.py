"""The latch of a value that is not a number names joint, channel, evidence and what to check."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_control.controller import Controller, Times
from hand_control.declared import Settings
from hand_control.supervisor import Phase
from hand_control.unmeasured import LATE_S
from hand_messages.health import Level
from hand_model.description import load_hand

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
COUNT = len(HAND.joints)
JOINT = HAND.joints[4]
STUCK = f"{JOINT} angle (channel 4): 14 equal readings of 31000 counts in a row; check the sensor and its cable"
OTHER = f"{HAND.joints[5]} pressure (channel 16): at the rail, 0 of 65535 counts; check for a broken wire or a short"
FORCE = f"{HAND.sensors.sites[0]} force (channel 30): at the rail, 65535 of 65535 counts; check for a broken wire"
COMMON = "every channel: the supply of the sensors is 3.00 V, 5 V are described; check this supply and its wiring"
START_NS, FRAME_NS = 1_000_000_000, 5_000_000


class Driven:
    """A controller that drives the hand at rest."""

    def __init__(self) -> None:
        self.controller = Controller(HAND, Settings.of(HAND, {}))
        self.now_ns = START_NS
        self.report()
        self.controller.enable(True)
        for _ in range(5):
            self.frame()
        assert self.controller.safety.phase is Phase.ACTIVE

    def frame(self, angle: float = 0.3, pressure: float = 5e4) -> None:
        """A frame whose joint JOINT is measured like this."""
        self.now_ns += FRAME_NS
        position, pressures = np.full(COUNT, 0.3), np.full(COUNT, 5e4)
        position[4], pressures[4] = angle, pressure
        times = Times(self.now_ns, self.now_ns, self.now_ns)
        self.controller.frame(times, position, np.zeros(COUNT), pressures)

    def report(self, *channels: str) -> None:
        self.controller.board_state(0, 2, "", channels, self.now_ns)

    @property
    def fault(self) -> str:
        return self.controller.safety.fault


@pytest.mark.parametrize("cause", [STUCK, COMMON])
def test_the_latch_names_the_cause_that_the_driver_reports(cause: str) -> None:
    """Fails when the line of the latch lacks the channel, the evidence or what to check, although they are known."""
    driven = Driven()
    driven.report(FORCE, OTHER, cause)
    assert driven.fault == ""
    driven.frame(angle=np.nan)
    assert driven.fault == f"{JOINT}: its angle (channel 4) is not a number; {cause}"


def test_a_cause_that_arrives_after_the_frame_completes_the_line() -> None:
    """Fails when the order of two topics decides whether the latch names its cause."""
    driven = Driven()
    driven.frame(pressure=np.nan)
    assert driven.fault.startswith(f"{JOINT}: its pressure (channel 15) is not a number; the driver has named no cause")
    driven.report(OTHER)
    assert "no cause" in driven.fault
    driven.report(STUCK)
    assert driven.fault == f"{JOINT}: its pressure (channel 15) is not a number; {STUCK}"
    assert driven.controller.safety.reason == driven.fault


def test_a_later_fault_is_no_cause_of_an_earlier_latch() -> None:
    """Fails when what breaks long afterwards is named as the cause, or the line of another fault is replaced."""
    driven = Driven()
    driven.frame(angle=np.nan)
    driven.now_ns += round((LATE_S + 0.01) * 1e9)
    driven.report(STUCK)
    assert "no cause" in driven.fault
    other = Driven()
    other.frame(angle=np.nan)
    other.controller.reset()
    other.controller.safety.trip("another fault")
    other.report(STUCK)
    assert other.fault == "another fault"


def test_a_hand_that_is_not_measured_is_not_enabled_and_the_cause_is_named() -> None:
    """Fails when `enable` succeeds and the hand then waits for ever, or a fault of a force sensor forbids it."""
    driven = Driven()
    driven.controller.vent("vent was called")
    driven.report(STUCK)
    with pytest.raises(ValueError, match=r"not enabled: .* angle \(channel 4\): 14 equal readings"):
        driven.controller.enable(True)
    said = driven.controller.board.health()
    assert said.level == Level.WARN and STUCK in said.message
    driven.report(FORCE)
    driven.controller.enable(True)
