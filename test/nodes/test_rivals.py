"""A second commander, a second simulation and a second controller in processes of their own: named, held, vented."""

from __future__ import annotations

import signal
import subprocess
import sys
from typing import TYPE_CHECKING, Any

from hand_ros.publishers import HOLD_S
from test.repeating import again_after_a_stall

if TYPE_CHECKING:
    from test.nodes.stack import Client, Stack, Started

STRANGE_PA = 599e3
STRANGER = """
import sys, time, rclpy
from builtin_interfaces.msg import Duration
from hand_msgs.msg import ValveCommand
rclpy.init()
node = rclpy.create_node("stranger")
publisher = node.create_publisher(ValveCommand, "/hand/valve_command", 1)
joints = sys.argv[1].split(",")
while True:
    message = ValveCommand(name=joints, pressure=[599e3] * len(joints), lifetime=Duration(sec=1))
    message.header.stamp = node.get_clock().now().to_msg()
    publisher.publish(message)
    time.sleep(0.005)
"""


def stranger(stack: Stack, client: Client) -> Started:
    joints = ",".join(client.joints[-1].name)
    process = subprocess.Popen([sys.executable, "-c", STRANGER, joints])
    stack.running.append(process)
    return process


def _stamp_s(message: Any) -> float:
    return float(message.header.stamp.sec + message.header.stamp.nanosec * 1e-9)


def named(client: Client, node: str, *texts: str) -> bool:
    return client.level(node, "authority") == 2 and all(client.said(node, "authority", text) for text in texts)


def driving(client: Client) -> None:
    client.controlling()
    client.command(index_proximal=0.8)
    client.until(lambda: abs(client.angle("index_proximal") - 0.8) < 0.03)
    client.joints.clear()
    client.valves.clear()
    client.until(lambda: client.joints and client.valves)


def rearmed(client: Client) -> None:
    """Reset both nodes and enable, as an operator does after the second publisher has been stopped."""
    client.until(lambda: client.level("controller", "authority") == 0)
    client.until(lambda: client.level("simulation", "authority") == 0)
    client.trigger("reset_driver")
    assert client.trigger("reset").success
    client.until(lambda: client.enable(True).success)  # the controller must have heard from the driver first
    driving(client)


@again_after_a_stall
def test_a_second_commander_is_named_never_obeyed_and_vents_the_hand(stack: Stack, client: Client) -> None:
    """Fails when a second commander moves the hand, is not named by both nodes, or is vented without a hold."""
    stack.node("simulation")
    stack.node("controller")
    driving(client)
    other = stranger(stack, client)
    where = f"valve_command from /stranger on this machine (process {other.pid}: "
    # Its first message begins the hold; DDS may name it later.
    client.until(lambda: 2 in (client.level("simulation", "authority"), client.level("controller", "authority")))
    noticed_s = client.node.get_clock().now().nanoseconds * 1e-9
    client.until(lambda: named(client, "simulation", where) and named(client, "controller", where))
    # The one that DDS shows the stranger first vents; for the other, a vented hand is no reason to latch.
    fault = "vented: second publisher: valve_command from "
    client.until(lambda: client.said("simulation", "safety", fault) or client.said("controller", "safety", fault))
    client.until(lambda: client.angle("index_proximal") < 0.2)
    client.spin(0.5)
    assert max(max(message.position) for message in client.joints) < 0.9
    index = list(client.joints[-1].name).index("index_proximal")
    vented_s = next(_stamp_s(m) for m in client.joints if m.position[index] < 0.7)
    assert HOLD_S - 0.2 < vented_s - noticed_s < HOLD_S + 0.5  # diagnostics are up to 0.1 s late
    assert not client.enable(True).success
    # It did publish; DDS may show it to this node later than to the others.
    client.until(lambda: any(min(valve.pressure) == STRANGE_PA for valve in client.valves))
    other.send_signal(signal.SIGKILL)  # DDS lists its publisher for 20 s more
    other.wait()
    client.until(lambda: client.level("simulation", "authority") == 0, timeout_s=5.0)
    rearmed(client)


@again_after_a_stall
def test_a_second_simulation_and_a_second_controller_are_named(stack: Stack, client: Client) -> None:
    """Fails when two sources of measurements, or two controllers, drive one hand unnoticed or unnamed."""
    stack.node("simulation")
    stack.node("controller")
    driving(client)
    second = stack.node("simulation", state_file=stack.folder / "second_simulation.json")
    from_second = f"from /hand/simulation on this machine (process {second.pid}: "
    client.until(lambda: named(client, "controller", "joint_states", from_second))
    client.until(lambda: client.said("controller", "safety", "vented: "))
    stack.stop(second)
    rearmed(client)
    second = stack.node("controller", enabled_at_start="false", state_file=stack.folder / "second_controller.json")
    from_second = f"valve_command from /hand/controller on this machine (process {second.pid}: "
    client.until(lambda: named(client, "simulation", from_second))
    client.until(lambda: client.angle("index_proximal") < 0.2)
    client.until(
        lambda: [line for line in stack.log("controller").split("\n") if "vented" in line and from_second in line]
    )
    stack.stop(second)
    rearmed(client)
