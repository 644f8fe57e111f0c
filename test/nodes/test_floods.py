"""Floods of commands from another process: the driver refuses them, goes on, and its memory does not grow."""

from __future__ import annotations

import math
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hand_msgs.msg import JointPressures, ValveCommand
from sensor_msgs.msg import JointState

from hand_ros.node import LIVE_QOS, STOPS_HZ, HandNode

if TYPE_CHECKING:
    from test.nodes.stack import Client, Stack

PUBLISH = """
import sys, time
import rclpy
from hand_msgs.msg import ContactForces, ValveCommand
from std_msgs.msg import Empty
rclpy.init()
node = rclpy.create_node("flood", namespace="hand")
kinds = {"valve_command": ValveCommand, "emergency_stop": Empty, "contact_forces": ContactForces}
publisher = node.create_publisher(kinds[sys.argv[5]], sys.argv[5], 1)
raw, rate_hz, count = bytes.fromhex(sys.argv[1]) * int(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4])
raw = b"\\0\\1\\0\\0" + raw[4:]
while publisher.get_subscription_count() < int(sys.argv[6]):
    time.sleep(0.05)
due = time.monotonic()
for _ in range(count):
    publisher.publish(raw)
    due += 1.0 / rate_hz
    time.sleep(max(due - time.monotonic(), 0.0))
time.sleep(0.5)
"""
NAMES = struct.pack("<I", 1_000_000) + struct.pack("<I", 2) + b"j\x00\x00\x00"
GROWTH_KB = 10_000
RATE_HZ, MOST_MISSED = 200.0, 0.05


def resident_kb(process: int) -> int:
    """Memory of a process that is resident [kB]."""
    lines = Path(f"/proc/{process}/status").read_text(encoding="utf-8").splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS")).split()[1])


def missed_share(states: Sequence[JointState | JointPressures | ValveCommand]) -> float:
    """Share of the periods between the first and the last state in which none was acquired, 0 to 1."""
    stamps_s = [message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec for message in states]
    assert stamps_s[-1] - stamps_s[0] > 1.0
    periods = float(stamps_s[-1] - stamps_s[0]) * RATE_HZ
    return max(0.0, 1.0 - (len(set(stamps_s)) - 1) / periods)


def usual_missed(states: Sequence[JointState | ValveCommand]) -> float:
    """Middle one of the numbers of missed periods of each second: what lasts, and no single stall."""
    seconds = np.array(sorted({m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in states}))
    counts, _ = np.histogram(seconds, np.arange(seconds[0], seconds[-1], 1.0))
    assert len(counts) >= 2
    return float(np.median(np.maximum(RATE_HZ - counts, 0.0)))


def flood_command(
    raw: bytes, times: int, rate_hz: float, count: int, topic: str = "valve_command", subscriptions: int = 1
) -> list[str]:
    """The command that waits for so many subscriptions and then publishes."""
    arguments = [raw.hex(), str(times), str(rate_hz), str(count), topic, str(subscriptions)]
    return [sys.executable, "-c", PUBLISH, *arguments]


@pytest.mark.parametrize(
    ("raw", "times", "rate_hz", "count"),
    [(NAMES, 1_000_000, 1.0, 4), (b"\xff" * 64, 1, 5000.0, 15_000)],
    ids=["12 MB of names", "5 kHz malformed"],
)
def test_a_flood_leaves_no_memory(
    stack: Stack, client: Client, raw: bytes, times: int, rate_hz: float, count: int
) -> None:
    """Fails when large messages stay in memory, stop the driver for more than 5 % of its periods, or are not named."""
    driver = stack.node("simulation")
    client.until(lambda: len(client.joints) > 100, 60.0)
    before_kb = resident_kb(driver.pid)
    flooding = subprocess.Popen(flood_command(raw, times, rate_hz, count))
    stack.running.append(flooding)
    client.until_said("simulation", "commands", "refused")
    client.joints.clear()
    client.until(lambda: flooding.poll() is not None, 60.0)
    assert flooding.returncode == 0
    assert missed_share(client.joints) <= MOST_MISSED
    received = len(client.joints)
    client.until(lambda: len(client.joints) > received + 100)
    assert resident_kb(driver.pid) - before_kb < GROWTH_KB


def stops(client: Client) -> tuple[HandNode, Callable[[], int], list[bool]]:
    """A node that listens, a call that delivers a stop and returns how many were acted upon, and whether it stands."""
    assert client.node  # it has started ROS
    node, received, acted, stopped = HandNode("listener", ()), [], [0], [False]
    create = node.create_subscription

    def create_subscription(kind: object, topic: str, callback: Callable[[bytes], None], *rest: object, **more: object):  # type: ignore[no-untyped-def]
        received.append(callback)
        return create(kind, topic, callback, *rest, **more)  # type: ignore[arg-type]

    node.create_subscription = create_subscription  # type: ignore[method-assign, assignment]

    def on_stop() -> None:
        acted[0] += 1
        stopped[0] = True

    node.listen_to_stop(on_stop, lambda: stopped[0])

    def deliver() -> int:
        received[0](b"\0\1\0\0\0")
        return acted[0]

    return node, deliver, stopped


def test_a_flood_of_stops_costs_little_and_every_stop_vents(client: Client) -> None:
    """Fails when each of many stops vents and stores a stopped hand again, or one does not stop a hand that drives."""
    node, deliver, stopped = stops(client)
    begun = time.monotonic()
    acted = [deliver() for _ in range(5000)][-1]
    assert acted <= 1 + STOPS_HZ + math.ceil((time.monotonic() - begun) * STOPS_HZ)
    assert "emergency_stop: more than 20 messages a second" in node.stop_health()[0].message
    for again in range(1, 1000):  # somebody resets and enables after each: the flood must stop the hand each time
        stopped[0] = False
        assert deliver() >= acted + again and stopped[0]
    node.destroy_node()


def test_a_flood_of_stops_leaves_the_nodes_at_work(stack: Stack, client: Client) -> None:
    """Fails when 5,000 stops a second are answered by as many commands, are not named, or stop the driver."""
    driver = stack.node("simulation")
    stack.node("controller", enabled_at_start="false")  # a stall of the machine would vent a hand that drives
    client.until(lambda: client.states and client.valves, 60.0)
    before_kb, vents = resident_kb(driver.pid), 0

    def count(_: object) -> None:
        nonlocal vents
        vents += 1

    client.node.create_subscription(ValveCommand, "valve_command", count, LIVE_QOS)
    count_s = time.monotonic()
    flooding = subprocess.Popen(flood_command(b"\0" * 5, 1, 5000.0, 15_000, "emergency_stop", 2))
    client.until(lambda: flooding.poll() is not None, 60.0)
    seconds = time.monotonic() - count_s
    assert vents < 300.0 * seconds
    for node in ("controller", "simulation"):
        client.until_said(node, "safety", "emergency stop")
        client.until_said(node, "emergency_stop", "more than 20 messages a second")
    received = len(client.joints)
    client.until(lambda: len(client.joints) > received + 100)
    assert max(client.valves[-1].pressure) == 0.0
    assert resident_kb(driver.pid) - before_kb < GROWTH_KB


CALL = """
import sys, time
import rclpy
from rcl_interfaces.srv import SetParameters
rclpy.init()
node = rclpy.create_node("flood", namespace="hand")
client = node.create_client(SetParameters, sys.argv[1] + "/set_parameters")
assert client.wait_for_service(30.0)
end, calls = time.monotonic() + float(sys.argv[2]), []
while time.monotonic() < end:
    calls = [call for call in calls if not call.done()]
    if len(calls) < 100:
        calls.append(client.call_async(SetParameters.Request()))
    rclpy.spin_once(node, timeout_sec=0.0)
"""


def test_a_flood_of_service_calls_leaves_the_driver_at_work(stack: Stack, client: Client) -> None:
    """Fails when calls of set_parameters without a pause cost the driver more than 5 % of its periods, or memory."""
    driver = stack.node("simulation")
    client.until(lambda: len(client.joints) > 100, 60.0)
    before_kb = resident_kb(driver.pid)
    flooding = subprocess.Popen([sys.executable, "-c", CALL, "/hand/simulation", "3.0"])
    stack.running.append(flooding)
    client.joints.clear()
    client.until(lambda: flooding.poll() is not None, 60.0)
    assert flooding.returncode == 0
    assert missed_share(client.joints) <= MOST_MISSED
    assert resident_kb(driver.pid) - before_kb < GROWTH_KB


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("enable", marks=pytest.mark.long),
        "controller/set_parameters",
        "follow_joint_trajectory",
        pytest.param("grasp", marks=pytest.mark.long),
    ],
)
def test_a_flood_of_calls_leaves_driver_and_controller_at_work(stack: Stack, client: Client, name: str) -> None:
    """Fails when calls of a service or an action without a pause cost either loop more than 5 % of most seconds, or
    memory. The campaign of faults counts every second.
    """
    nodes = [stack.node("simulation"), stack.node("controller")]
    client.controlling()
    before_kb = [resident_kb(node.pid) for node in nodes]
    flooding = stack.module("validation.faults.rogue_calls", name, "--seconds", "4")
    client.until(lambda: "begun" in stack.log("rogue_calls"), 60.0)
    client.joints.clear()
    client.valves.clear()
    client.until(lambda: flooding.poll() is not None, 60.0)
    assert flooding.returncode == 0, stack.log("rogue_calls")
    assert int(stack.log("rogue_calls").split()[-1]) > 500
    print("missed", missed_share(client.joints), missed_share(client.valves), stack.log("rogue_calls"))
    assert usual_missed(client.joints) <= MOST_MISSED * RATE_HZ
    assert usual_missed(client.valves) <= MOST_MISSED * RATE_HZ
    for node, used_kb in zip(nodes, before_kb, strict=True):
        assert resident_kb(node.pid) - used_kb < GROWTH_KB


def test_a_flood_of_joint_states_leaves_the_driver_at_work(stack: Stack, client: Client) -> None:
    """Fails when 5,000 joint states a second of another node cost the driver more than 5 %, or memory, or drive."""
    nodes = [stack.node("simulation"), stack.node("controller")]
    client.controlling()
    measured: list[JointPressures] = []
    client.node.create_subscription(JointPressures, "pressures", measured.append, 50)
    before_kb = [resident_kb(node.pid) for node in nodes]
    flooding = stack.module("validation.faults.rogue", "joint_states", "absurd", "--rate", "5000", "--seconds", "3")
    named = ("simulation", "safety"), ("controller", "safety")  # whichever vents first
    client.until(lambda: any(client.said(*status, "second publisher") for status in named))
    client.until(lambda: flooding.poll() is not None, 60.0)
    assert flooding.returncode == 0, stack.log("rogue")
    assert missed_share(measured) <= MOST_MISSED
    assert max(client.valves[-1].pressure) == 0.0
    for node, used_kb in zip(nodes, before_kb, strict=True):
        assert resident_kb(node.pid) - used_kb < GROWTH_KB


def test_large_messages_of_publishers_that_end_leave_no_memory(stack: Stack, client: Client) -> None:
    """Fails when the pieces of a message that was not received whole stay in the controller, once per publisher."""
    stack.node("simulation")
    controller = stack.node("controller")
    client.controlling()
    before_kb = resident_kb(controller.pid)
    for _ in range(2):
        flooding = subprocess.Popen(flood_command(NAMES, 1_000_000, 2.0, 8, "contact_forces"))
        stack.running.append(flooding)
        client.until(lambda flooding=flooding: flooding.poll() is not None, 60.0)  # type: ignore[misc]
        assert flooding.returncode == 0
    client.spin(1.0)
    assert resident_kb(controller.pid) - before_kb < GROWTH_KB
