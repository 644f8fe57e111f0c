"""Who may drive the hand: disabled at the start, latched over a restart, the emergency stop, the heartbeat."""

from __future__ import annotations

import signal
import time
from typing import TYPE_CHECKING

from builtin_interfaces.msg import Duration
from hand_msgs.msg import ValveCommand
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Empty
from std_srvs.srv import Trigger

from test.nodes.stack import BEST_EFFORT

if TYPE_CHECKING:
    from test.nodes.stack import Client, Stack

FULL_PA = 3e5


def driven(client: Client) -> bool:
    """Whether any valve was commanded above 0 Pa so far."""
    return any(max(valve.pressure) > 0.0 for valve in client.valves)


def press(client: Client, nodes: int, qos: QoSProfile | int = 1) -> None:
    """Publish one emergency stop once so many nodes listen; its publisher stays alive."""
    publisher = client.node.create_publisher(Empty, "emergency_stop", qos)
    client.until(lambda: publisher.get_subscription_count() >= nodes)
    client.spin(1.0)  # a publisher knows a subscriber before the subscriber knows it
    publisher.publish(Empty())


def test_a_node_starts_disabled_and_a_fault_survives_restarts(stack: Stack, client: Client) -> None:
    """Fails when a controller drives before `enable`, or after a restart with a latched fault, or logs it often."""
    simulation = stack.node("simulation")
    controller = stack.node("controller", enabled_at_start="false")
    client.until(lambda: client.said("controller", "safety", "vented: not enabled"))
    client.until(lambda: client.states)
    client.command(index_proximal=0.8)
    client.until_said("controller", "commands", "command refused: the hand is not being controlled")
    assert not driven(client)
    nothing = client.trigger("reset")
    assert not nothing.success and "no fault is latched" in nothing.message
    assert client.enable(True).success
    client.command(index_proximal=0.8)
    client.until(lambda: client.said("controller", "safety", "controlling"))
    client.until(lambda: driven(client))
    simulation.send_signal(signal.SIGSTOP)
    client.until_said("controller", "safety", "no usable sensor data for 100 ms")
    simulation.send_signal(signal.SIGCONT)
    client.spin(0.3)
    for number in (signal.SIGINT, signal.SIGKILL):
        stack.stop(controller, number)
        client.valves.clear()
        client.statuses.clear()
        controller = stack.node("controller", enabled_at_start="true")
        client.until_said("controller", "safety", " the line to the board (latched ")
        client.spin(0.2)
        assert not driven(client)
        assert not client.enable(True).success
    client.spin(2.5)
    assert stack.log("controller").count("vented: no usable sensor data") == 3  # once in the life of each controller
    reset = client.trigger("reset")
    assert reset.success and "no usable sensor data" in reset.message
    client.spin(0.3)
    assert not driven(client)
    stack.stop(controller)
    client.statuses.clear()
    stack.node("controller", enabled_at_start="true")
    client.until(lambda: client.said("controller", "safety", "controlling"))


def test_a_controller_that_cannot_keep_its_latch_does_not_drive(stack: Stack, client: Client) -> None:
    """Fails when a state file that is damaged or cannot be written is ignored, or takes more than one line."""
    (stack.folder / "damaged.json").write_text("{", encoding="utf-8")
    stack.node("simulation")
    controller = stack.node("controller", state_file=stack.folder / "damaged.json")
    client.until_said("controller", "safety", "damaged.json cannot be used: it is not JSON; call reset, then enable")
    assert client.level("controller", "safety") == 2
    stack.stop(controller)
    client.statuses.clear()
    stack.node("controller", state_file=stack.folder / "damaged.json" / "below.json")
    client.until_said("controller", "safety", "below.json cannot be used: ")
    assert not client.trigger("reset").success
    assert not client.enable(True).success
    assert not driven(client)


def test_the_stop_vents_controller_and_driver_until_each_is_reset(stack: Stack, client: Client) -> None:
    """Fails when a stop of any publisher does not vent at once, is not latched, or `enable` alone ends it."""
    stack.node("simulation")
    stack.node("controller")
    client.controlling()
    client.command(index_proximal=0.8)
    client.until(lambda: abs(client.angle("index_proximal") - 0.8) < 0.02)
    stops: list[Empty] = []
    client.node.create_subscription(Empty, "emergency_stop", stops.append, 10)
    press(client, 3)
    client.until(lambda: len(stops) == 3)  # both nodes pass it on, once
    client.until_said("controller", "safety", "emergency stop: a message arrived on emergency_stop")
    client.until_said("simulation", "safety", "emergency stop: a message arrived on emergency_stop; call reset_driver")
    client.valves.clear()
    client.spin(0.2)
    assert not driven(client)
    assert not client.enable(True).success
    assert client.trigger("reset").success
    assert not client.enable(True).success  # the driver still has its own latch
    assert client.call(Trigger, "reset_driver", Trigger.Request()).success
    client.until(lambda: client.trigger("reset") and client.enable(True).success)
    client.until(lambda: client.said("controller", "safety", "controlling"))
    best_effort = client.node.create_publisher(Empty, "emergency_stop", BEST_EFFORT)
    client.until(lambda: best_effort.publish(Empty()) or client.said("controller", "safety", "emergency stop"))


def test_the_driver_alone_obeys_the_stop(stack: Stack, client: Client) -> None:
    """Fails when the driver needs the controller to vent, keeps pressure for more than a few periods, or re-arms."""
    simulation = stack.node("simulation")
    client.until(lambda: client.joints and client.valve_publisher.get_subscription_count() > 0)
    names = list(client.joints[-1].name)

    def send() -> None:
        message = ValveCommand(name=names, pressure=[FULL_PA] * len(names), lifetime=Duration(sec=1))
        message.header.stamp = client.node.get_clock().now().to_msg()
        client.valve_publisher.publish(message)

    client.sending(send, lambda: max(client.joints[-1].position) > 0.2)
    send()
    press(client, 1)
    client.until_said("simulation", "safety", "emergency stop")
    send()
    client.until_said("simulation", "commands", "a fault is latched (emergency stop")
    client.until(lambda: max(client.joints[-1].position) < 0.0)
    stack.stop(simulation, signal.SIGKILL)
    client.statuses.clear()
    stack.node("simulation")
    client.until_said("simulation", "safety", "emergency stop: a message arrived on emergency_stop (latched ")
    reset = client.call(Trigger, "reset_driver", Trigger.Request())
    assert reset.success and "emergency stop" in reset.message
    again = client.call(Trigger, "reset_driver", Trigger.Request())
    assert not again.success and again.message == "no fault of the driver is latched"
    client.joints.clear()
    client.until(lambda: client.joints)
    client.sending(send, lambda: max(client.joints[-1].position) > 0.2)


def test_a_retained_stop_reaches_nodes_that_start_later(stack: Stack, client: Client) -> None:
    """Fails when a node that starts after the stop drives although the publisher of the stop retains it."""
    press(client, 0, QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    stack.node("simulation")
    stack.node("controller")
    client.until_said("controller", "safety", "emergency stop")
    client.until_said("simulation", "safety", "emergency stop")


def test_a_missing_heartbeat_vents(stack: Stack, client: Client) -> None:
    """Fails when a hand that needs a heartbeat is enabled without one, or is driven on when it ends."""
    stack.node("simulation", heartbeat_timeout_s=0.5)
    stack.node("controller", heartbeat_timeout_s=0.5, enabled_at_start="false")
    client.until_said("controller", "safety", "vented: not enabled")
    refused = client.enable(True)
    assert not refused.success and "no heartbeat for 0.5 s" in refused.message
    publisher = client.node.create_publisher(Empty, "heartbeat", 1)
    timer = client.node.create_timer(0.1, lambda: publisher.publish(Empty()))
    client.heard()
    assert client.enable(True).success
    client.controlling()
    client.command(index_proximal=0.8)
    client.until(lambda: abs(client.angle("index_proximal") - 0.8) < 0.02)
    timer.cancel()
    ended_s = time.monotonic()
    client.until(lambda: max(client.valves[-1].pressure) == 0.0)
    assert 0.3 < time.monotonic() - ended_s < 1.0
    client.until_said("controller", "safety", "no heartbeat for 0.5 s")
