"""What the tool does on a running hand over ROS 2: the demo's poses, experiments. The only rclpy module here."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import rclpy
from builtin_interfaces.msg import Duration
from hand_msgs.msg import ControllerState, ValveCommand
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_ros.node import DEFAULT_NAMESPACE, QUEUED_QOS, RETAINED_QOS, SENSOR_QOS, join_graph, leave_graph
from hand_tool.processes import READY_S

RUNNING_S, DISCOVERY_S = 15.0, 1.0
"""Longest wait for a hand that should be running already; what it takes to hear of every other node."""
TICK_S = 0.1
RECORDER = "recorder"
"""Name of the node that records for this command; other nodes may listen, too."""
LIFETIME_NS = 100_000_000
"""Of an experiment's set-points: when the tool is stopped the board vents."""
LOST_S = 0.3
"""Angles older than this end an experiment; the driver vents earlier, where it still runs."""
CHECKED_ROWS = 20
"""The hand is checked once in so many rows of set-points."""
BEYOND_RAD = np.radians(8.0)
"""An angle further than this outside its limits ends an experiment."""


class NotReadyError(RuntimeError):
    """The nodes did not come up; the message is one line."""


@dataclass(slots=True)
class Measured:
    """The newest angles [rad] by joint, and when they arrived: time of the monotonic clock [s]."""

    angle_rad: dict[str, float] = field(default_factory=dict)
    at_s: float = -math.inf

    def take(self, message: JointState) -> None:
        """Take a message that has just arrived."""
        self.angle_rad.update(zip(message.name, message.position, strict=True))
        self.at_s = time.monotonic()


@dataclass(frozen=True, slots=True)
class Pose:
    """A pose to reach: label, angles [rad] in the joints' order, time to move [s], time to stay [s]."""

    label: str
    angle_rad: Array
    move_s: float
    stay_s: float


def perform(
    joints: Sequence[str],
    poses: Sequence[Pose],
    urdf: str,
    on_progress: Callable[[str, float], None],
    healthy: Callable[[], None],
) -> None:
    """Send the poses one after the other as trajectories; returns after the last.

    urdf: published as robot_description, so that the recording has it; empty: not published.
    on_progress(label, seconds) is called about ten times a second, healthy() too: it raises to give up.
    Raises NotReadyError when no controller answers.
    """
    join_graph()  # Ctrl-C must leave us able to vent
    node = rclpy.create_node("demo", namespace=DEFAULT_NAMESPACE)
    executor = EventsExecutor()
    executor.add_node(node)
    seen = [0]

    def count(_state: bytes) -> None:
        seen[0] += 1

    try:
        node.create_subscription(ControllerState, "controller_state", count, SENSOR_QOS, raw=True)
        publisher = node.create_publisher(JointTrajectory, "joint_trajectory", QUEUED_QOS)
        described = ("robot_description",) if urdf else ()
        for topic in described:
            node.create_publisher(String, topic, RETAINED_QOS).publish(String(data=urdf))
        end = time.monotonic() + READY_S
        # The recorder must hear the commands from the first on: nothing moves before it listens, too.
        driven = ("joint_trajectory", "valve_command", "joint_states", "pressures", "contact_forces", "adc")
        recorded = driven + described
        while seen[0] == 0 or publisher.get_subscription_count() < 2 or not _recorded(node, recorded):
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
        leave_graph(node, executor)


def _recorded(node: Node, topics: Sequence[str]) -> bool:
    """Whether the recorder listens to all these topics."""
    listeners = ([info.node_name for info in node.get_subscriptions_info_by_topic(topic)] for topic in topics)
    return all(RECORDER in names for names in listeners)


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


def run_experiment(hand: Hand, commands: Array, namespace: str, healthy: Callable[[], None]) -> Iterator[float]:
    """Send set-points (T, joints) [Pa] at the board's rate; yields the share done, vents at the end and on any error.

    Raises NotReadyError where no hand answers or it falls silent, somebody else commands the valves, or an angle leaves
    its limits.
    """
    join_graph()  # Ctrl-C must leave us able to vent
    node = rclpy.create_node("experiment", namespace=namespace)
    executor = EventsExecutor()
    executor.add_node(node)
    latest = Measured()
    node.create_subscription(JointState, "joint_states", latest.take, QUEUED_QOS)
    publisher = node.create_publisher(ValveCommand, "valve_command", QUEUED_QOS)
    vent = np.zeros(len(hand.joints))
    try:
        _await_hand(node, executor, publisher, latest, healthy)
        begun, period_s = time.monotonic(), 1.0 / hand.rate_hz
        for k, row in enumerate(commands):
            _spin(executor, max(begun + k * period_s - time.monotonic(), 0.0))
            publisher.publish(_valve_command(node, hand, row))
            if k % CHECKED_ROWS == 0:
                healthy()
                _check_alone(node)
                if time.monotonic() - latest.at_s > LOST_S:
                    _spin(executor, TICK_S)  # this process may have stood still: what has arrived is read first
                _check_angles(hand, latest, time.monotonic())
                yield (k + 1) / len(commands)
        yield 1.0
    finally:
        for _ in range(3):
            publisher.publish(_valve_command(node, hand, vent))
            _spin(executor, 0.02)
        leave_graph(node, executor)


def _await_hand(
    node: Node, executor: EventsExecutor, publisher: Any, latest: Measured, healthy: Callable[[], None]
) -> None:
    end = time.monotonic() + RUNNING_S
    recorded = ("joint_states", "valve_command")
    while (
        not latest.angle_rad or publisher.get_subscription_count() < 2 or not _recorded(node, recorded)
    ):  # it and the hand
        _spin(executor, TICK_S)
        healthy()
        if time.monotonic() > end:
            raise NotReadyError(f"no joint_states, valve or recorder within {RUNNING_S:g} s")
    _spin(executor, DISCOVERY_S)
    _check_alone(node)


def _check_alone(node: Node) -> None:
    if node.count_publishers("valve_command") > 1:
        raise NotReadyError("another node commands the valves; stop the controller first")


def _valve_command(node: Node, hand: Hand, pressure_pa: Array) -> ValveCommand:
    message = ValveCommand(name=list(hand.joints), pressure=pressure_pa.tolist())
    message.header.stamp = node.get_clock().now().to_msg()
    message.lifetime = Duration(sec=0, nanosec=LIFETIME_NS)
    return message


def _check_angles(hand: Hand, latest: Measured, now_s: float) -> None:
    if now_s - latest.at_s > LOST_S:
        raise NotReadyError(f"no joint_states for {LOST_S:g} s; check the driver and the board; vented")
    for joint, low, high in zip(hand.joints, hand.limits.low_rad, hand.limits.high_rad, strict=True):
        angle = latest.angle_rad.get(joint, low)
        if not low - BEYOND_RAD <= angle <= high + BEYOND_RAD:
            limits = f"{np.degrees(low):.0f} to {np.degrees(high):.0f}"
            raise NotReadyError(f"{joint} is at {np.degrees(angle):.1f} degrees, outside {limits}; vented")
