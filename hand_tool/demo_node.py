"""The demo's hands-on part over ROS 2: wait for the controller, send shapes, watch. The only rclpy module here."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import rclpy
from builtin_interfaces.msg import Duration
from hand_msgs.msg import ControllerState
from numpy.typing import NDArray
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.task import Future
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from hand_ros.node import DEFAULT_NAMESPACE, QUEUED_QOS, SENSOR_QOS

READY_S = 60.0
"""Longest wait for the controller: discovery takes seconds, a first compile of the kernels some more."""
TICK_S = 0.1
LISTENERS = 2
"""Of our trajectories: the controller and the recorder."""


class NotReadyError(RuntimeError):
    """The nodes did not come up; the message is one line."""


@dataclass(frozen=True, slots=True)
class Pose:
    """A pose to reach: label, angles [rad] in the joints' order, time to move [s], time to stay [s]."""

    label: str
    angle_rad: NDArray[np.float64]
    move_s: float
    stay_s: float


def perform(
    joints: Sequence[str],
    poses: Sequence[Pose],
    on_progress: Callable[[str, float], None],
    healthy: Callable[[], None],
) -> None:
    """Send the poses one after the other as trajectories; returns after the last.

    on_progress(label, seconds) is called about ten times a second, healthy() too: it raises to give up.
    Raises NotReadyError when no controller answers.
    """
    rclpy.init()
    node = rclpy.create_node("demo", namespace=DEFAULT_NAMESPACE)
    executor = EventsExecutor()
    executor.add_node(node)
    seen = [0]

    def count(_state: bytes) -> None:
        seen[0] += 1

    try:
        node.create_subscription(ControllerState, "controller_state", count, SENSOR_QOS, raw=True)
        publisher = node.create_publisher(JointTrajectory, "joint_trajectory", QUEUED_QOS)
        end = time.monotonic() + READY_S
        # The recorder must hear the commands from the first on: nothing moves before it listens, too.
        while seen[0] == 0 or publisher.get_subscription_count() < LISTENERS or not _recorded(node):
            _spin(executor, TICK_S)
            healthy()
            on_progress("waiting for simulation and controller", TICK_S)
            if time.monotonic() > end:
                raise NotReadyError(f"no controller_state within {READY_S:g} s")
        for pose in poses:
            publisher.publish(_trajectory(joints, pose))
            for _ in range(round((pose.move_s + pose.stay_s) / TICK_S)):
                _spin(executor, TICK_S)
                healthy()
                on_progress(pose.label, TICK_S)
    finally:
        executor.remove_node(node)
        node.destroy_node()
        rclpy.try_shutdown()


def _recorded(node: Node) -> bool:
    """Whether the recorder listens to the commands beside the simulation."""
    return bool(node.count_subscribers("valve_command") >= LISTENERS)


def _spin(executor: EventsExecutor, seconds: float) -> None:
    executor.spin_until_future_complete(Future(), timeout_sec=seconds)


def _trajectory(joints: Sequence[str], pose: Pose) -> JointTrajectory:
    """One point with zero end velocity, so that the motion starts and ends smoothly; stamp 0 means now."""
    seconds = int(pose.move_s)
    point = JointTrajectoryPoint(
        positions=pose.angle_rad.tolist(),
        velocities=[0.0] * len(joints),
        time_from_start=Duration(sec=seconds, nanosec=round((pose.move_s - seconds) * 1e9)),
    )
    return JointTrajectory(joint_names=list(joints), points=[point])
