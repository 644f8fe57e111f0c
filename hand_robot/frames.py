"""The frames of a URDF as transforms of TF: those that are fixed, and those that joints move. No ROS.

The transforms come from the document that is published as robot_description, so that the two cannot differ.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation


@dataclass(frozen=True, slots=True)
class Transform:
    """Where a child frame is in its parent, and the joint that turns it.

    xyz_m: (3,).  rotation: unit quaternion x, y, z, w at angle 0.  joint: "" for a fixed frame.
    turn: rotation times the axis of the joint as a quaternion, so that `turned` is one sum.
    """

    parent: str
    child: str
    xyz_m: tuple[float, ...]
    rotation: tuple[float, ...]
    joint: str = ""
    turn: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)

    def turned(self, angle_rad: float) -> list[float]:
        """The rotation x, y, z, w with the joint at an angle [rad]."""
        cosine, sine = math.cos(angle_rad / 2.0), math.sin(angle_rad / 2.0)
        return [cosine * start + sine * turn for start, turn in zip(self.rotation, self.turn, strict=True)]


def transforms_of(urdf: str, frame_prefix: str = "") -> tuple[Transform, ...]:
    """The transforms of all joints of a URDF, fixed or revolute, in its order.

    frame_prefix: what precedes every frame on TF. Raises ValueError, one line, for a joint of another type.
    """
    return tuple(
        _transform(joint, frame_prefix) for joint in ET.fromstring(urdf).iter("joint") if "type" in joint.attrib
    )


def _transform(joint: ET.Element, frame_prefix: str) -> Transform:
    kind, name = joint.get("type"), joint.get("name", "")
    if kind not in ("fixed", "revolute"):
        raise ValueError(f"joint {name} is {kind}; TF is published for fixed and revolute joints")
    parent, child = (frame_prefix + joint.find(end).get("link", "") for end in ("parent", "child"))  # type: ignore[union-attr]
    origin = joint.find("origin")
    place = {} if origin is None else origin.attrib
    rotation = Rotation.from_euler("xyz", _numbers(place.get("rpy", "0 0 0")))
    xyz = tuple(_numbers(place.get("xyz", "0 0 0")))
    start = tuple(rotation.as_quat().tolist())
    if kind == "fixed":
        return Transform(parent, child, xyz, start)
    axis = joint.find("axis")
    direction = np.array(_numbers("1 0 0" if axis is None else axis.get("xyz", "1 0 0")))
    unit = direction / np.linalg.norm(direction)
    vector, scalar = np.array(start[:3]), start[3]
    turn = (*(scalar * unit + np.cross(vector, unit)).tolist(), -float(vector @ unit))
    return Transform(parent, child, xyz, start, name, turn)


def _numbers(text: str) -> list[float]:
    return [float(part) for part in text.split()]
