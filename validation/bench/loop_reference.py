"""The reference of the loop bench: plain rclpy, the same messages, one SingleThreadedExecutor per process.

python -m validation.bench.loop_reference sensor RATE_HZ | control.  Runs until SIGINT or SIGTERM.
"""

from __future__ import annotations

import sys
from array import array

import rclpy
from builtin_interfaces.msg import Duration
from hand_msgs.msg import AdcFrame, ContactForces, ControllerState, JointPressures, ValveCommand
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

JOINTS = [f"{finger}_{part}" for finger in ("index", "middle", "ring", "little", "thumb") for part in ("prox", "dist")]
JOINTS.append("thumb_opposition")
BEST_EFFORT = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
CHANNELS = 33


class Sensor(Node):
    """Publishes the topics of the driver from a timer and subscribes to the valve commands."""

    def __init__(self, rate_hz: float) -> None:
        super().__init__("reference_sensor", namespace="hand")
        self.states = self.create_publisher(JointState, "joint_states", 10)
        self.pressures = self.create_publisher(JointPressures, "pressures", BEST_EFFORT)
        self.forces = self.create_publisher(ContactForces, "contact_forces", BEST_EFFORT)
        self.adc = self.create_publisher(AdcFrame, "adc", BEST_EFFORT)
        self.create_subscription(ValveCommand, "valve_command", lambda _: None, 1)
        self.values = array("d", [0.5] * len(JOINTS))
        self.create_timer(1.0 / rate_hz, self.sample)

    def sample(self) -> None:
        """Publish one sample of every topic."""
        stamp = self.get_clock().now().to_msg()
        pressures = JointPressures(name=JOINTS, pressure=self.values)
        states = JointState(name=JOINTS, position=self.values, velocity=self.values, effort=self.values)
        forces = ContactForces(name=JOINTS, force=self.values)
        adc = AdcFrame(supply_voltage=5.0, channel=list(range(CHANNELS)), counts=list(range(CHANNELS)))
        for message in (pressures, states, forces, adc):
            message.header.stamp = stamp
        self.pressures.publish(pressures)
        self.states.publish(states)
        self.forces.publish(forces)
        self.adc.publish(adc)


class Control(Node):
    """Answers each joint state with a valve command and a controller state; computes nothing."""

    def __init__(self) -> None:
        super().__init__("reference_control", namespace="hand")
        self.commands = self.create_publisher(ValveCommand, "valve_command", 1)
        self.states = self.create_publisher(ControllerState, "controller_state", BEST_EFFORT)
        self.create_subscription(JointPressures, "pressures", self.keep, BEST_EFFORT)
        self.create_subscription(JointState, "joint_states", self.answer, 10)
        self.pressure = array("d", [0.0] * len(JOINTS))

    def keep(self, message: JointPressures) -> None:
        """Keep the newest pressures."""
        self.pressure = message.pressure

    def answer(self, message: JointState) -> None:
        """Publish a command and a state with the stamp of a joint state."""
        command = ValveCommand(name=JOINTS, pressure=self.pressure, lifetime=Duration(nanosec=100_000_000))
        command.header.stamp = message.header.stamp
        self.commands.publish(command)
        floats = ("reference", "position", "error", "pressure_command", "torque_estimate", "torque_limit")
        flags = [False] * len(JOINTS)
        state = ControllerState(name=JOINTS, saturated=flags, contact=flags, **dict.fromkeys(floats, message.position))
        state.header.stamp = message.header.stamp
        self.states.publish(state)


def main() -> None:
    """Run the node that the first argument names: sensor, with a rate [Hz], or control."""
    rclpy.init()
    node = Sensor(float(sys.argv[2])) if sys.argv[1] == "sensor" else Control()
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        return


if __name__ == "__main__":
    main()
