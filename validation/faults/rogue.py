"""A second publisher on one topic of the hand, in a process of its own: python -m validation.faults.rogue TOPIC KIND.

KIND is full (valid values that a hand must not obey from a second publisher), absurd (NaN), random (commands of the
family `commands`, each wrong in another way), huge (messages of a million names) or malformed (random bytes).

Example: python -m validation.faults.rogue valve_command full --seconds 2
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rclpy
from hand_msgs.msg import BoardState, ContactForces, JointPressures, ValveCommand
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from hand_ros.node import QUEUED_QOS
from validation.faults import commands
from validation.faults.closed_loop import description

TYPES: dict[str, Any] = {
    "valve_command": ValveCommand,
    "joint_commands": JointState,
    "joint_trajectory": JointTrajectory,
    "joint_states": JointState,
    "pressures": JointPressures,
    "contact_forces": ContactForces,
    "board_state": BoardState,
    "emergency_stop": Empty,
    "heartbeat": Empty,
}
KINDS = ("full", "absurd", "random", "huge", "malformed")
NAMES = 1_000_000
FULL_PA, FULL_RAD = 5.5e5, 1.2


def main() -> int:
    """Publish until the time is over; exit code 0."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.faults.rogue",
        description="Publish on one topic of the hand as a second, faulty node.",
        epilog="Example: python -m validation.faults.rogue valve_command full --seconds 2",
    )
    parser.add_argument("topic", choices=TYPES)
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("--rate", type=float, default=200.0, help="messages per second")
    parser.add_argument("--seconds", type=float, default=2.0, help="how long")
    parser.add_argument("--count", type=int, default=0, help="end after this many messages instead")
    parser.add_argument("--seed", type=int, default=0, help="seed of random bytes")
    options = parser.parse_args()
    rclpy.init()
    node = rclpy.create_node("rogue", namespace="hand")
    publisher = node.create_publisher(TYPES[options.topic], options.topic, QUEUED_QOS)
    end = time.monotonic() + 10.0
    while publisher.get_subscription_count() == 0 and time.monotonic() < end:
        time.sleep(0.02)
    make = maker(options.topic, options.kind, np.random.default_rng(options.seed))
    print("begun", flush=True)
    begun = time.monotonic()
    sent = 0
    while (passed := time.monotonic() - begun) < options.seconds or sent < options.count:
        if 0 < options.count <= sent:
            break
        if sent < passed * options.rate:
            publisher.publish(make())
            sent += 1
        else:
            time.sleep(0.0005)
    print(f"sent {sent}", flush=True)
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


def maker(topic: str, kind: str, rng: np.random.Generator) -> Callable[[], Any]:
    """A function that makes the next message."""
    if kind == "malformed":
        return lambda: b"\x00\x01\x00\x00" + rng.bytes(int(rng.integers(0, 400)))
    if kind == "random":
        return lambda: absurd(topic, rng)
    count = NAMES if kind == "huge" else 0
    names = [f"j{k}" for k in range(count)] if count else list(description().joints)
    value = float("nan") if kind == "absurd" else FULL_PA
    angle = float("nan") if kind == "absurd" else FULL_RAD
    kept = content(topic, names, [value] * len(names), [angle] * len(names))

    def stamped() -> Any:
        if hasattr(kept, "header"):
            kept.header.stamp.sec, kept.header.stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)
        return kept

    return stamped


def absurd(topic: str, rng: np.random.Generator) -> Any:
    """A command with something wrong."""
    joints = list(description().joints)
    if topic == "valve_command":
        return commands.absurd_valve_command(rng, joints, time.time_ns())
    if topic == "joint_trajectory":
        names, points = commands.absurd_trajectory(rng)
        message = JointTrajectory(joint_names=names)
        for time_s, position, velocity in points[:50]:
            point = JointTrajectoryPoint(positions=position, velocities=velocity)
            nanoseconds = round(1e9 * min(max(np.nan_to_num(time_s, nan=-1.0), -1e9), 1e9))
            point.time_from_start.sec, point.time_from_start.nanosec = divmod(nanoseconds, 1_000_000_000)
            message.points.append(point)
        return message
    names, position, effort = commands.names_and_values(rng, joints)
    return JointState(name=names, position=position, effort=effort)


def content(topic: str, names: list[str], pressure: list[float], angle: list[float]) -> Any:
    """A message of a topic with these names, pressures [Pa] and angles [rad]."""
    zero = [0.0] * len(names)
    if topic == "valve_command":
        message = ValveCommand(name=names, pressure=pressure)
        message.lifetime.nanosec = 100_000_000
        return message
    if topic == "joint_trajectory":
        point = JointTrajectoryPoint(positions=angle)
        point.time_from_start.sec = 1
        return JointTrajectory(joint_names=names, points=[point])
    if topic == "pressures":
        return JointPressures(name=names, pressure=pressure)
    if topic == "contact_forces":
        return ContactForces(name=names, force=zero)
    if topic == "board_state":
        return BoardState(name=names, set_point=pressure, link_up=True, protocol=2)
    if topic in ("emergency_stop", "heartbeat"):
        return Empty()
    return JointState(name=names, position=angle, velocity=zero, effort=[] if topic == "joint_commands" else zero)


if __name__ == "__main__":
    sys.exit(main())
