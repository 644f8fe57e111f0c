"""The tags of ros2_control in the URDF, and the settings of its controllers.

`topic_based` uses joint_state_topic_hardware_interface (ros-controls/topic_based_hardware_interfaces): it reads
`joint_states` and writes `joint_commands` of this stack, so that the safety of driver and controller stays in force.
`mujoco` uses mujoco_ros2_control, which runs the MJCF with servos in place of driver, controller and hand.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

from hand_model.description import Hand
from hand_robot.xml_text import Style, number

CONTROL = ("topic_based", "mujoco")
UPDATE_RATE_HZ = 200
NEVER_SKIP = "-1"
"""Send every command: the threshold of the interface is on the sum over all joints and would hold small steps back."""


def control_element(hand: Hand, style: Style, control: str, namespace: str, mujoco_model: str) -> ET.Element:
    """The element `ros2_control` of a hand. control: one of CONTROL. Raises ValueError, one line, for another one."""
    if control not in CONTROL:
        raise ValueError(f"ros2_control is '{control}'; it must be one of none, {', '.join(CONTROL)}")
    root = ET.Element("ros2_control", name=style.name(hand.prefix + "hand"), type="system")
    hardware = ET.SubElement(root, "hardware")
    plugin = ET.SubElement(hardware, "plugin")
    if control == "topic_based":
        plugin.text = "joint_state_topic_hardware_interface/JointStateTopicSystem"
        topics = {"joint_commands_topic": "joint_commands", "joint_states_topic": "joint_states"}
        parameters = {name: f"/{namespace.strip('/')}/{topic}" for name, topic in topics.items()}
        parameters["trigger_joint_command_threshold"] = NEVER_SKIP
    else:
        plugin.text = "mujoco_ros2_control/MujocoSystemInterface"
        parameters = {"mujoco_model": mujoco_model}
    for name, value in parameters.items():
        ET.SubElement(hardware, "param", name=name).text = value
    for index, name in enumerate(hand.joints):
        joint = ET.SubElement(root, "joint", name=style.name(name))
        command = ET.SubElement(joint, "command_interface", name="position")
        for bound, limit in (("min", hand.limits.low_rad[index]), ("max", hand.limits.high_rad[index])):
            ET.SubElement(command, "param", name=bound).text = number(limit)
        for state in ("position", "velocity", "effort"):
            ET.SubElement(joint, "state_interface", name=state)
    return root


def controller_names(prefix: str) -> tuple[str, str]:
    """Names of the trajectory controller and of the broadcaster of a hand with this prefix."""
    return f"{prefix}hand_controller", f"{prefix}hand_state_broadcaster"


def controllers(hand: Hand) -> dict[str, Any]:
    """The content of controllers.yaml: a joint trajectory controller and a broadcaster for one hand."""
    trajectory, broadcaster = controller_names(hand.prefix)
    return {
        "controller_manager": {
            "ros__parameters": {
                "update_rate": UPDATE_RATE_HZ,
                trajectory: {"type": "joint_trajectory_controller/JointTrajectoryController"},
                broadcaster: {"type": "joint_state_broadcaster/JointStateBroadcaster"},
            }
        },
        trajectory: {
            "ros__parameters": {
                "joints": list(hand.joints),
                "command_interfaces": ["position"],
                "state_interfaces": ["position", "velocity"],
                "allow_partial_joints_goal": True,
                "constraints": {
                    "goal_time": 2.0,
                    "stopped_velocity_tolerance": 0.2,
                    **{name: {"goal": 0.05} for name in hand.joints},
                },
            }
        },
        broadcaster: {
            "ros__parameters": {"joints": list(hand.joints), "interfaces": ["position", "velocity", "effort"]}
        },
    }
