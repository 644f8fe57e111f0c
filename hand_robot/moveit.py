"""The files of a MoveIt configuration of a hand or of several, as texts: of the package `moveit`, or for a robot's own.

MoveIt drives the hand by its own action follow_joint_trajectory, so that no ros2_control is needed between them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from hand_control.declared import PARAMETERS
from hand_model.yaml_document import yaml_text
from hand_robot.srdf import Placed, fingers, srdf_text
from hand_robot.urdf import max_speed_rad_s

SOLVER = "kdl_kinematics_plugin/KDLKinematicsPlugin"
MANAGER = "moveit_simple_controller_manager"


def moveit_files(placed: Sequence[Placed], robot: str = "") -> dict[str, str]:
    """Texts by the name of the file. robot: name in the URDF of a robot with these hands; empty: that of the hand.

    Raises ValueError, one line, for a hand without geometry.
    """
    return {
        f"{robot or placed[0].hand.name}.srdf": srdf_text(placed, robot),
        "joint_limits.yaml": yaml_text(joint_limits(placed)),
        "kinematics.yaml": yaml_text(kinematics(placed)),
        "moveit_controllers.yaml": yaml_text(moveit_controllers(placed)),
    }


def max_acceleration_rad_s2() -> float:
    """The largest acceleration [rad/s^2] of a joint's reference, by the default of the controller."""
    (declared,) = (parameter for parameter in PARAMETERS if parameter.name == "max_acceleration_deg_per_s2")
    assert isinstance(declared.default, float)
    return math.radians(declared.default)


def joint_limits(placed: Sequence[Placed]) -> dict[str, Any]:
    """Limits that a plan keeps; those of the angles come from the URDF."""
    limit = {
        "has_velocity_limits": True,
        "max_velocity": round(max_speed_rad_s(), 6),
        "has_acceleration_limits": True,
        "max_acceleration": round(max_acceleration_rad_s2(), 6),
    }
    scaling = {"default_velocity_scaling_factor": 0.3, "default_acceleration_scaling_factor": 0.1}
    return scaling | {"joint_limits": {joint: dict(limit) for each in placed for joint in each.hand.joints}}


def kinematics(placed: Sequence[Placed]) -> dict[str, Any]:
    """A finger has two or three joints, so that its tip can reach a position, but not an orientation as well."""
    solver = {"kinematics_solver": SOLVER, "kinematics_solver_timeout": 0.01, "position_only_ik": True}
    return {finger: dict(solver) for each in placed for finger in fingers(each.hand)}


def moveit_controllers(placed: Sequence[Placed]) -> dict[str, Any]:
    """The action of each hand as a controller of MoveIt; MoveIt joins the name and action_ns with a slash."""
    action = {"type": "FollowJointTrajectory", "action_ns": "follow_joint_trajectory", "default": True}
    actions = {each.namespace.strip("/"): action | {"joints": list(each.hand.joints)} for each in placed}
    return {
        "moveit_controller_manager": f"{MANAGER}/MoveItSimpleControllerManager",
        MANAGER: {"controller_names": list(actions), **actions},
    }
