"""The messages of the hand as tables of fields, for the fixed-layout codec in cdr.py.

Field types are those of .msg files; `header`, `time` and `duration` stand for the standard structures.
"""

from __future__ import annotations

from typing import NamedTuple


class MessageSpec(NamedTuple):
    """A message type and its fields (name, type) in wire order."""

    type: str
    fields: tuple[tuple[str, str], ...]


JOINT_STATE = MessageSpec(
    "sensor_msgs/msg/JointState",
    (
        ("header", "header"),
        ("name", "string[]"),
        ("position", "float64[]"),
        ("velocity", "float64[]"),
        ("effort", "float64[]"),
    ),
)

JOINT_PRESSURES = MessageSpec(
    "hand_msgs/msg/JointPressures",
    (("header", "header"), ("name", "string[]"), ("pressure", "float64[]")),
)

CONTACT_FORCES = MessageSpec(
    "hand_msgs/msg/ContactForces",
    (("header", "header"), ("name", "string[]"), ("force", "float64[]")),
)

ADC_FRAME = MessageSpec(
    "hand_msgs/msg/AdcFrame",
    (
        ("header", "header"),
        ("sequence", "uint32"),
        ("supply_voltage", "float64"),
        ("channel", "uint16[]"),
        ("counts", "uint32[]"),
    ),
)

VALVE_COMMAND = MessageSpec(
    "hand_msgs/msg/ValveCommand",
    (("header", "header"), ("lifetime", "duration"), ("name", "string[]"), ("pressure", "float64[]")),
)

CONTROLLER_STATE = MessageSpec(
    "hand_msgs/msg/ControllerState",
    (
        ("header", "header"),
        ("name", "string[]"),
        ("reference", "float64[]"),
        ("position", "float64[]"),
        ("error", "float64[]"),
        ("pressure_command", "float64[]"),
        ("torque_estimate", "float64[]"),
        ("torque_limit", "float64[]"),
        ("saturated", "bool[]"),
        ("contact", "bool[]"),
    ),
)

CLOCK = MessageSpec("rosgraph_msgs/msg/Clock", (("clock", "time"),))

ALL = (JOINT_STATE, JOINT_PRESSURES, CONTACT_FORCES, ADC_FRAME, VALVE_COMMAND, CONTROLLER_STATE, CLOCK)
