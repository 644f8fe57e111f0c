"""URDF of a hand, alone or on a mount, and the same as a xacro macro for both hands.

The root link NAME_base has no mass, because robot_state_publisher's kinematics library ignores the inertia of a root.
Fingertips and force sites are links without a body. Limits come from the description; the speed limit is the largest
speed of the controller's reference.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hand_control.declared import PARAMETERS
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.geometry import PALM, Frame, Link, Shape, geometry_of, pose, rotation_about
from hand_robot.ros2_control import CONTROL, control_element
from hand_robot.xml_text import Style, document, number, numbers

BASE = "hand_base"
"""Root link of the hand, before the prefix."""
COLORS = {"palm": "0.25 0.27 0.30 1", "link": "0.75 0.77 0.80 1"}
# A capsule lies along x, a cylinder of URDF along z.
_ALONG_X = rotation_about(np.array([0.0, 1.0, 0.0]), math.pi / 2.0)


@dataclass(frozen=True, slots=True)
class Mount:
    """What carries the hand. link: name of the parent link.  xyz_m, rpy_rad: the base of the hand in its frame."""

    link: str = ""
    xyz_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)


def urdf_text(
    hand: Hand,
    mount: Mount | None = None,
    control: Literal["none", "topic_based", "mujoco"] = "none",
    namespace: str = "hand",
    mujoco_model: str = "hand.xml",
) -> str:
    """A URDF document.

    control: tags for ros2_control.  namespace: of the hand's topics.  mujoco_model: path of the MJCF.
    Raises ValueError, one line, for a hand without geometry.
    """
    style = Style(hand.prefix)
    root = ET.Element("robot", name=hand.prefix + hand.name)
    for name, color in COLORS.items():
        material = ET.SubElement(root, "material", name=hand.prefix + name)
        ET.SubElement(material, "color", rgba=color)
    if mount is not None and mount.link:
        ET.SubElement(root, "link", name=mount.link)
        joint = _fixed(root, hand.prefix + BASE, mount.link)
        ET.SubElement(joint, "origin", xyz=numbers(mount.xyz_m), rpy=numbers(mount.rpy_rad))
    root.extend(_body(hand, style))
    if control != "none":
        root.append(control_element(hand, style, control, namespace, mujoco_model))
    return document(root, f"Made by: hand urdf, from {hand.path.name}. Lengths in m, angles in rad, masses in kg.")


def description_text(hand: Hand) -> str:
    """The text of the topic robot_description; empty for a hand without geometry."""
    return "" if hand.geometry is None else urdf_text(hand)


def macro_text(hand: Hand) -> str:
    """The xacro macro `fluidic_hand`: of this hand, and with the other `side` of its mirror image."""
    style = Style(hand.prefix, symbolic=True)
    side = geometry_of(hand).side
    ET.register_namespace("xacro", XACRO)
    root = ET.Element("robot")
    defaults = f"prefix:='' side:='' parent:='' ros2_control:=none namespace:=hand mujoco_model:=hand.xml {MOUNT}"
    macro = ET.SubElement(root, f"{{{XACRO}}}macro", name=hand.name, params=defaults)
    chosen = "side if side else ('left' if 'left' in prefix.split('_') else 'right')"
    ET.SubElement(macro, f"{{{XACRO}}}property", name="chosen_side", value=f"${{{chosen}}}")
    reflect = f"${{1 if chosen_side == '{side}' else -1}}"
    ET.SubElement(macro, f"{{{XACRO}}}property", name="reflect", value=reflect)
    for name, color in COLORS.items():
        material = ET.SubElement(macro, "material", name=style.name(hand.prefix + name))
        ET.SubElement(material, "color", rgba=color)
    mounted = ET.SubElement(macro, f"{{{XACRO}}}if", value="${parent != ''}")
    joint = _fixed(mounted, style.name(hand.prefix + BASE), "${parent}")
    ET.SubElement(joint, "origin", xyz="${xyz}", rpy="${rpy}")
    macro.extend(_body(hand, style))
    for control in CONTROL:
        when = ET.SubElement(macro, f"{{{XACRO}}}if", value=f"${{ros2_control == '{control}'}}")
        when.append(control_element(hand, style, control, "${namespace}", "${mujoco_model}"))
    return document(root, f"Made by: hand urdf, from {hand.path.name}. Lengths in m, angles in rad, masses in kg.")


XACRO = "http://www.ros.org/wiki/xacro"
MOUNT = "xyz:='0 0 0' rpy:='0 0 0'"


def max_speed_rad_s() -> float:
    """The largest speed [rad/s] of a joint's reference, by the default of the controller."""
    (declared,) = (parameter for parameter in PARAMETERS if parameter.name == "max_speed_deg_per_s")
    assert isinstance(declared.default, float)
    return math.radians(declared.default)


def _body(hand: Hand, style: Style) -> list[ET.Element]:
    """Links and joints, from the base on."""
    geometry = geometry_of(hand)
    speed = max_speed_rad_s()
    base = style.name(hand.prefix + BASE)
    holder = ET.Element("holder")
    ET.SubElement(holder, "link", name=base)
    for link in geometry.links:
        _add_link(holder, hand, style, link)
        if link.joint < 0:
            style.origin(_fixed(holder, style.name(link.name), base), link.origin)
        else:
            _add_joint(holder, hand, style, link, speed)
    for frame in geometry.frames:
        _add_frame(holder, style, frame)
    return list(holder)


def _fixed(root: ET.Element, child: str, parent: str) -> ET.Element:
    joint = ET.SubElement(root, "joint", name=f"{child}_joint", type="fixed")
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    return joint


def _add_frame(root: ET.Element, style: Style, frame: Frame) -> None:
    ET.SubElement(root, "link", name=style.name(frame.name))
    style.origin(_fixed(root, style.name(frame.name), style.name(frame.link)), frame.pose)


def _add_joint(root: ET.Element, hand: Hand, style: Style, link: Link, speed_rad_s: float) -> None:
    index = link.joint
    joint = ET.SubElement(root, "joint", name=style.name(hand.joints[index]), type="revolute")
    ET.SubElement(joint, "parent", link=style.name(link.parent))
    ET.SubElement(joint, "child", link=style.name(link.name))
    style.origin(joint, link.origin)
    style.axis(joint, link.axis)
    limits = hand.limits
    ET.SubElement(
        joint,
        "limit",
        lower=number(limits.low_rad[index]),
        upper=number(limits.high_rad[index]),
        effort=number(limits.max_torque_nm[index]),
        velocity=number(speed_rad_s),
    )
    damping = hand.row("dynamics.viscous_friction_nm_s_per_rad")[index]
    friction = hand.row("coulomb_friction.torque_nm")[index]
    ET.SubElement(joint, "dynamics", damping=number(damping), friction=number(friction))


def _add_link(root: ET.Element, hand: Hand, style: Style, link: Link) -> None:
    element = ET.SubElement(root, "link", name=style.name(link.name))
    inertial = ET.SubElement(element, "inertial")
    style.origin(inertial, pose(link.center_m))
    ET.SubElement(inertial, "mass", value=number(link.mass_kg))
    zero = dict.fromkeys(("ixy", "ixz", "iyz"), "0")
    moments = dict(zip(("ixx", "iyy", "izz"), map(number, link.inertia_kg_m2), strict=True))
    ET.SubElement(inertial, "inertia", {**moments, **zero})
    color = style.name(hand.prefix + ("palm" if link.name == hand.prefix + PALM else "link"))
    for kind in ("visual", "collision"):
        for shape in link.shapes:
            for place, solid in _solids(shape):
                body = ET.SubElement(element, kind)
                style.origin(body, place)
                ET.SubElement(body, "geometry").append(solid)
                if kind == "visual":
                    ET.SubElement(body, "material", name=color)


def _solids(shape: Shape) -> list[tuple[Array, ET.Element]]:
    """Poses and solids of URDF that a shape consists of; a capsule is a cylinder with a sphere at both ends."""
    if shape.kind == "box":
        return [(shape.pose, ET.Element("box", size=numbers(shape.size_m)))]
    length, radius = shape.size_m
    cylinder = ET.Element("cylinder", length=number(length), radius=number(radius))
    ends = [shape.pose @ pose(np.array([sign * length / 2.0, 0.0, 0.0])) for sign in (-1.0, 1.0)]
    spheres = [(end, ET.Element("sphere", radius=number(radius))) for end in ends]
    return [(shape.pose @ pose(np.zeros(3), _ALONG_X), cylinder), *spheres]
