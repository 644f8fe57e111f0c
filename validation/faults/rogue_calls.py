"""Calls of one service, or goals of one action, without a pause: python -m validation.faults.rogue_calls NAME.

At most PENDING calls wait for their answer. What is asked for is what a node of a user may ask for by mistake: enable a
hand that is enabled, reset without a fault, set no parameter, follow a trajectory of a joint that does not exist.

Example: python -m validation.faults.rogue_calls enable --seconds 2
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from typing import Any

import rclpy
from control_msgs.action import FollowJointTrajectory
from hand_msgs.action import Grasp
from rcl_interfaces.srv import SetParameters
from rclpy.action import ActionClient
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from validation.faults.closed_loop import description

PENDING = 100
"""Calls that wait at once."""
JOINED_S = 30.0
SERVICES: dict[str, tuple[Any, Any]] = {
    "enable": (SetBool, SetBool.Request(data=True)),
    "reset": (Trigger, Trigger.Request()),
    "reset_driver": (Trigger, Trigger.Request()),
    "controller/set_parameters": (SetParameters, SetParameters.Request()),
    "simulation/set_parameters": (SetParameters, SetParameters.Request()),
}
"""Type and request by the name of the service; none of them changes a hand that is driven."""
ACTIONS: dict[str, Any] = {
    "follow_joint_trajectory": FollowJointTrajectory,
    "follow_joint_trajectory, wrong": FollowJointTrajectory,
    "grasp": Grasp,
}
"""Type by the name of the action, with `, wrong` for goals that are refused whole."""


def main() -> int:
    """Call until the time is over; exit code 0, or 1 where nobody answers."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.faults.rogue_calls",
        description="Call one service, or one action, of the hand without a pause.",
        epilog="Example: python -m validation.faults.rogue_calls enable --seconds 2",
    )
    parser.add_argument("name", choices=[*SERVICES, *ACTIONS])
    parser.add_argument("--seconds", type=float, default=2.0, help="how long")
    options = parser.parse_args()
    rclpy.init()
    node = rclpy.create_node("rogue_calls", namespace="hand")
    found, send = caller(node, options.name)
    if not found(timeout_sec=JOINED_S):
        print(f"nobody offers {options.name}", file=sys.stderr)
        return 1
    print("begun", flush=True)
    print(f"sent {flood(node, send, options.seconds)}", flush=True)
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


def caller(node: Node, name: str) -> tuple[Callable[..., bool], Callable[[], Any]]:
    """What waits for a service or an action, and what calls it and returns the future of the answer."""
    if name in SERVICES:
        kind, request = SERVICES[name]
        client = node.create_client(kind, name)
        return client.wait_for_service, lambda: client.call_async(request)
    action = ActionClient(node, ACTIONS[name], name.partition(",")[0])
    return action.wait_for_server, lambda: action.send_goal_async(goal(name))


def goal(name: str) -> Any:
    """A goal of an action."""
    if name == "grasp":
        return Grasp.Goal(pattern="no such pattern", closure=0.5, max_torque=0.1)
    joints = ["no_such_joint"] if name.endswith("wrong") else list(description().joints)
    point = JointTrajectoryPoint(positions=[0.4] * len(joints))
    point.time_from_start.sec = 1
    return FollowJointTrajectory.Goal(trajectory=JointTrajectory(joint_names=joints, points=[point]))


def flood(node: Node, send: Callable[[], Any], seconds: float) -> int:
    """Call for `seconds` [s]; the number of calls."""
    waiting: list[Any] = []
    end, sent = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        waiting = [call for call in waiting if not call.done()]
        if len(waiting) < PENDING:
            waiting.append(send())
            sent += 1
        rclpy.spin_once(node, timeout_sec=0.0 if len(waiting) < PENDING else 0.01)
    return sent


if __name__ == "__main__":
    sys.exit(main())
