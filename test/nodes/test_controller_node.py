"""The controller node within the test's process: what it does with a frame, without waiting for its timers."""

from __future__ import annotations

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


@pytest.fixture
def controller(tmp_path: Path) -> Iterator[Fed]:
    rclpy.init(args=["controller", "--ros-args", "-p", f"state_file:={tmp_path / 'state.json'}"])
    node = Fed()
    node.trigger_configure()
    node.trigger_activate()
    yield node
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
