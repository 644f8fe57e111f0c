"""The controller node within the test's process: what it does with a frame, without waiting for its timers."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rclpy

from hand_control.node import ControllerNode
from hand_messages.cdr import Layout
from hand_messages.layouts import JOINT_PRESSURES, JOINT_STATE


class Fed(ControllerNode):
    """The controller node, which receives frames from the test."""

    def feed(self, angle_rad: float = 0.1) -> None:
        """Receive a frame in which every joint is at one angle [rad], without pressure."""
        joints, stamp_ns = self._hand.joints, self._now_ns()
        angle, zero = np.full(len(joints), angle_rad), np.zeros(len(joints))
        self._on_pressures(Layout(JOINT_PRESSURES, "hand", joints).encode(stamp_ns, pressure=zero))
        self._on_joint_states(
            Layout(JOINT_STATE, "hand", joints).encode(stamp_ns, position=angle, velocity=zero, effort=zero)
        )

    def wait(self, angle_rad: float | None = None, seconds: float = 2.2) -> None:
        """Let time pass, with the watch of the node and frames of one angle [rad]; None: without frames."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            if angle_rad is not None:
                self.feed(angle_rad)
            self._on_watch()
            time.sleep(0.02)


@pytest.fixture
def controller(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Fed]:
    """The node, disabled, or enabled at its start where the test asks for that."""
    at_start = str(getattr(request, "param", False)).lower()
    parameters = (f"state_file:={tmp_path / 'state.json'}", f"enabled_at_start:={at_start}")
    rclpy.init(args=["controller", "--ros-args", *(word for pair in parameters for word in ("-p", pair))])
    node = Fed()
    try:
        node.trigger_configure()
        node.trigger_activate()
        yield node
    finally:
        node.finish()
        node.destroy_node()
        rclpy.try_shutdown()


def test_a_fault_of_a_frame_is_stored_with_the_frame(controller: Fed, tmp_path: Path) -> None:
    """Fails when a controller that is killed before its next watch has lost its latch."""
    controller._controller.enable(True)
    controller.feed()
    assert not (tmp_path / "state.json").exists()
    controller.feed(np.nan)
    assert "is not a number" in (tmp_path / "state.json").read_text(encoding="utf-8")


def test_a_fault_is_stored_when_the_controller_is_deactivated(controller: Fed, tmp_path: Path) -> None:
    """Fails when a controller that is deactivated before its next watch, and configured again, has lost its latch."""
    controller._controller.safety.trip("a fault between two frames")
    controller.trigger_deactivate()
    assert "a fault between two frames" in (tmp_path / "state.json").read_text(encoding="utf-8")
    controller.trigger_cleanup()
    controller.trigger_configure()
    assert controller._controller.safety.fault.startswith("a fault between two frames (latched ")


def test_a_hand_that_is_not_measured_is_not_driven_later(controller: Fed, capfd: pytest.CaptureFixture[str]) -> None:
    """Fails when a hand moves long after it was enabled, or the log does not say why it does not move."""
    controller._controller.enable(True)
    controller.wait(np.nan)
    controller.feed()
    assert controller._controller.safety.phase.name == "VENTED"
    line = f"not driven: no complete measurement within 2 s; {controller._hand.joints[0]}: its angle (channel "
    assert line in capfd.readouterr().err
    controller._controller.enable(True)
    controller.feed()
    assert controller._controller.safety.phase.name == "ACTIVE"


@pytest.mark.parametrize("controller", [True], indirect=True)
def test_a_hand_enabled_at_the_start_waits_for_the_driver(controller: Fed) -> None:
    """Fails when a driver that starts three seconds after the controller finds the hand disabled."""
    controller.wait(seconds=3.0)
    assert controller._controller.safety.phase.name == "ARMING"
    controller.feed()
    assert controller._controller.safety.phase.name == "ACTIVE"
