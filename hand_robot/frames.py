"""The frames of a URDF as transforms of TF: those that are fixed, and those that joints move. No ROS.

The transforms come from the document that is published as robot_description, so that the two cannot differ.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from hand_model.arrays import Array


@dataclass(frozen=True, slots=True)
class Transform:
    """Where a child frame is in its parent at angle 0, and the joint that turns it.

    xyz_m: (3,).  rotation: (4,) unit quaternion x, y, z, w.  axis: (3,) unit vector in the child; joint "" for none.
    """

    parent: str
    child: str
    xyz_m: Array
    rotation: Array
    joint: str = ""
    axis: Array | None = None

    def turned(self, angle_rad: float) -> Array:
        """The rotation, (4,) x, y, z, w, with the joint at an angle [rad]."""
        if self.axis is None:
            return self.rotation
        half = math.sin(angle_rad / 2.0) * self.axis
        w = math.cos(angle_rad / 2.0)
        vector, scalar = self.rotation[:3], self.rotation[3]
        return np.append(scalar * half + w * vector + np.cross(vector, half), scalar * w - vector @ half)


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
    rotation = Rotation.from_euler("xyz", _numbers(place.get("rpy", "0 0 0"))).as_quat()
    xyz = np.array(_numbers(place.get("xyz", "0 0 0")))
    if kind == "fixed":
        return Transform(parent, child, xyz, rotation)
    axis = joint.find("axis")
    direction = np.array(_numbers("1 0 0" if axis is None else axis.get("xyz", "1 0 0")))
    return Transform(parent, child, xyz, rotation, name, direction / np.linalg.norm(direction))


def _numbers(text: str) -> Sequence[float]:
    return [float(part) for part in text.split()]
