"""A hand's publishers as a process of their own: every topic of a board, at one rate.

Usage: talker.py RATE_HZ TOPICS. Says "ready" once each topic has a subscriber, then publishes until SIGINT and
prints, as JSON, how many messages went out on each topic.
"""

from __future__ import annotations

import json
import signal
import sys
import threading
import time
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from hand_msgs.msg import AdcFrame, ContactForces, ControllerState, JointPressures, ValveCommand
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

from hand_messages import layouts
from hand_messages.cdr import Layout

JOINTS = [f"{f}_{p}" for f in ("thumb", "index", "middle", "ring", "little") for p in ("proximal", "distal")]
JOINTS.append("thumb_opposition")
SENSOR = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
RELIABLE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
TABLE = (
    ("/hand/joint_states", JointState, layouts.JOINT_STATE, RELIABLE),
    ("/hand/pressures", JointPressures, layouts.JOINT_PRESSURES, SENSOR),
    ("/hand/contact_forces", ContactForces, layouts.CONTACT_FORCES, SENSOR),
    ("/hand/adc", AdcFrame, layouts.ADC_FRAME, SENSOR),
    ("/hand/valve_command", ValveCommand, layouts.VALVE_COMMAND, RELIABLE),
    ("/hand/controller_state", ControllerState, layouts.CONTROLLER_STATE, SENSOR),
    ("/left_hand/joint_states", JointState, layouts.JOINT_STATE, RELIABLE),
    ("/hand/joint_commands", JointState, layouts.JOINT_STATE, RELIABLE),
    ("/hand/other", JointState, layouts.JOINT_STATE, RELIABLE),
)


def _layout(spec: layouts.MessageSpec) -> Layout:
    if spec is layouts.ADC_FRAME:
        return Layout(spec, "hand", lengths={"channel": 33, "counts": 33})
    return Layout(spec, "hand", JOINTS)


def main(rate_hz: float, topics: int) -> None:
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = Node("talker")
    node.create_publisher(DiagnosticArray, "/diagnostics", RELIABLE)
    publishers = [(node.create_publisher(kind, name, qos), _layout(spec)) for name, kind, spec, qos in TABLE[:topics]]
    while not all(publisher.get_subscription_count() for publisher, _ in publishers) and not stop.wait(0.02):
        pass
    print("ready", flush=True)
    sent, due = 0, time.monotonic()
    while not stop.is_set():
        for publisher, layout in publishers:
            values: dict[str, Any] = {
                slot.key: sent if slot.length is None else [sent % 100] * slot.length for slot in layout.slots
            }
            if "channel" in values:
                values["channel"] = range(33)
            values["stamp_ns"] = time.time_ns()
            publisher.publish(layout.encode(**values))
        sent += 1
        due += 1.0 / rate_hz
        stop.wait(max(due - time.monotonic(), 0.0))
    print(json.dumps({name: sent for name, *_ in TABLE[:topics]}), flush=True)
    rclpy.try_shutdown()


if __name__ == "__main__":
    main(float(sys.argv[1]), int(sys.argv[2]))
