"""MJCF of a hand for MuJoCo, with Eq. 6 as actuators whose control is the pressure set-point in Pa, or with servos.

A valve is a first-order filter (dynprm: its time constant), and the torque a_0 + a_1 phi + a_2 p + a_3 p phi is an
affine gain and an affine bias over the joint angle. The moving parts of an actuator are armature. As in the nominal
model, links are without weight (gravcomp); friction of the nominal model is damping and frictionloss. Not in this
model: dead time and flow limits of the valve, creep of the material, and the effects of the catalogue.

A servo stands for valve, actuator and controller of a joint: its control is an angle. So position commands of
ros2_control move the hand; its torque is bounded as that of the controller, its motion in time is not that of the hand.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

import numpy as np

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.geometry import MIDDLE_RAD, Geometry, Link, geometry_of, mass_matrix
from hand_robot.srdf import may_touch
from hand_robot.xml_text import document, number, numbers

PAD_RADIUS_M = 0.006
"""Radius of the site of a touch sensor."""
FULL_TORQUE_RAD = math.radians(5.0)
"""Error of a servo at which it gives the largest torque of its joint."""


def mjcf_text(hand: Hand, servos: bool = False) -> str:
    """An MJCF document. servos: controls are angles [rad] instead of pressures [Pa].

    Raises ValueError, one line, for a hand without geometry.
    """
    geometry = geometry_of(hand)
    root = ET.Element("mujoco", model=hand.prefix + hand.name)
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    ET.SubElement(root, "option", timestep="0.0005", integrator="implicitfast")
    defaults = ET.SubElement(ET.SubElement(root, "default"), "geom")
    defaults.set("rgba", "0.75 0.77 0.80 1")
    world = ET.SubElement(root, "worldbody")
    bodies = {"": world}
    armature = armatures(hand)
    for link in geometry.links:
        bodies[link.name] = _add_body(bodies[link.parent], hand, link, armature)
    for frame in geometry.frames:
        size = number(PAD_RADIUS_M if frame.kind == "force_site" else 0.002)
        site = ET.SubElement(bodies[frame.link], "site", name=frame.name, size=size)
        _place(site, frame.pose)
    _add_contacts(root, hand)
    if servos:
        _add_servos(root, hand)
    else:
        _add_actuators(root, hand)
    _add_sensors(root, hand, geometry)
    controls = "angles in rad" if servos else "pressures in Pa"
    return document(root, f"Made by: hand urdf, from {hand.path.name}. Controls are {controls}.")


def armatures(hand: Hand) -> Array:
    """Inertia (joints,) [kg m^2] that a joint has beyond its links in the middle of the range; never negative."""
    links = mass_matrix(hand, np.full(len(hand.joints), MIDDLE_RAD)).diagonal()
    left_over: Array = np.maximum(hand.row("dynamics.inertia_kg_m2") - links, 0.0)
    return left_over


def _place(element: ET.Element, pose: Array) -> None:
    """Position and, column by column, the x and y axes: no convention of angles is involved."""
    element.set("pos", numbers(pose[:3, 3]))
    element.set("xyaxes", numbers(np.concatenate([pose[:3, 0], pose[:3, 1]])))


def _add_body(parent: ET.Element, hand: Hand, link: Link, armature: Array) -> ET.Element:
    body = ET.SubElement(parent, "body", name=link.name, gravcomp="1")
    _place(body, link.origin)
    inertia = {"pos": numbers(link.center_m), "mass": number(link.mass_kg)}
    ET.SubElement(body, "inertial", {**inertia, "diaginertia": numbers(link.inertia_kg_m2)})
    if link.joint >= 0:
        index = link.joint
        limits = (hand.limits.low_rad[index], hand.limits.high_rad[index])
        ET.SubElement(
            body,
            "joint",
            name=hand.joints[index],
            type="hinge",
            axis=numbers(link.axis),
            range=numbers(limits),
            damping=number(hand.row("dynamics.viscous_friction_nm_s_per_rad")[index]),
            frictionloss=number(hand.row("coulomb_friction.torque_nm")[index]),
            armature=number(armature[index]),
        )
    for shape in link.shapes:
        if shape.kind == "box":
            geom = ET.SubElement(body, "geom", type="box", size=numbers(np.array(shape.size_m) / 2.0))
            _place(geom, shape.pose)
        else:
            length, radius = shape.size_m
            ends = np.array([-length / 2.0, length / 2.0])[:, None] * shape.pose[:3, 0] + shape.pose[:3, 3]
            ET.SubElement(body, "geom", type="capsule", size=number(radius), fromto=numbers(ends.ravel()))
    return body


def _add_contacts(root: ET.Element, hand: Hand) -> None:
    """No contact between neighbours: MuJoCo itself leaves them out only where the parent is not fixed to the world."""
    contact = ET.SubElement(root, "contact")
    for first, second, _ in may_touch(hand):
        ET.SubElement(contact, "exclude", body1=first, body2=second)


def _add_actuators(root: ET.Element, hand: Hand) -> None:
    """Eq. 6: gain a_2 + a_3 phi over the pressure, bias a_0 + a_1 phi."""
    actuator = ET.SubElement(root, "actuator")
    a0, a1, a2, a3 = (
        hand.row(f"statics.{key}") for key in ("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad")
    )
    for index, joint in enumerate(hand.joints):
        ET.SubElement(
            actuator,
            "general",
            name=joint,
            joint=joint,
            dyntype="filterexact",
            dynprm=number(hand.row("valve.time_constant_s")[index]),
            ctrlrange=numbers((0.0, hand.limits.max_pressure_pa[index])),
            gaintype="affine",
            gainprm=numbers((a2[index], a3[index], 0.0)),
            biastype="affine",
            biasprm=numbers((a0[index], a1[index], 0.0)),
        )


def _add_servos(root: ET.Element, hand: Hand) -> None:
    """Position actuators, critically damped together with the friction of the joint where the finger is straight."""
    actuator = ET.SubElement(root, "actuator")
    limits = hand.limits
    stiffness = limits.max_torque_nm / FULL_TORQUE_RAD
    inertia = np.abs(mass_matrix(hand, np.zeros(len(hand.joints)))).sum(axis=1) + armatures(hand)
    critical = 2.0 * np.sqrt(stiffness * inertia)
    damping = np.maximum(critical - hand.row("dynamics.viscous_friction_nm_s_per_rad"), 0.0)
    for index, joint in enumerate(hand.joints):
        torque = limits.max_torque_nm[index]
        ET.SubElement(
            actuator,
            "position",
            name=joint,
            joint=joint,
            kp=number(stiffness[index]),
            kv=number(damping[index]),
            ctrlrange=numbers((limits.low_rad[index], limits.high_rad[index])),
            forcerange=numbers((-torque, torque)),
        )


def _add_sensors(root: ET.Element, hand: Hand, geometry: Geometry) -> None:
    sensor = ET.SubElement(root, "sensor")
    for joint in hand.joints:
        ET.SubElement(sensor, "jointpos", name=f"{joint}_angle", joint=joint)
        ET.SubElement(sensor, "actuatorfrc", name=f"{joint}_torque", actuator=joint)
    for frame in geometry.frames:
        if frame.kind == "force_site":
            ET.SubElement(sensor, "touch", name=f"{frame.name}_force", site=frame.name)
