"""SRDF of a hand: groups, named states from the grasp patterns, and pairs of links that may touch."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hand_control.grasps import Grasp
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.geometry import PALM, Link, geometry_of, link_poses
from hand_robot.xml_text import document, number

HANDS = "hands"
"""Name of the group of several hands."""
POINTS = 9
"""Points on the centre line of a link at which distances to other links are taken."""


def fingers(hand: Hand) -> dict[str, tuple[str, list[str]]]:
    """The frame of the tip and the joints of every finger, from its base to its tip, by the name of its group."""
    links = {link.name: link for link in geometry_of(hand).links}
    found = {}
    for frame in geometry_of(hand).frames:
        if frame.kind != "fingertip":
            continue
        chain, link = [], links[frame.link]
        while link.joint >= 0:
            chain.append(hand.joints[link.joint])
            link = links[link.parent]
        found[frame.name.removesuffix("_tip")] = (frame.name, chain[::-1])
    return found


@dataclass(frozen=True, slots=True)
class Placed:
    """A hand on its robot. grasps: patterns, each the named state of its closed hand.

    namespace: of the hand's topics.  mount: parent link of the hand; empty: none.
    """

    hand: Hand
    grasps: Mapping[str, Grasp]
    namespace: str = "hand"
    mount: str = ""

    @property
    def group(self) -> str:
        """Name of the group of all joints of the hand."""
        return f"{self.hand.prefix}hand"


def srdf_text(placed: Sequence[Placed], robot: str = "") -> str:
    """An SRDF document of the hands of a robot. robot: its name in the URDF; empty: that of the first hand.

    Several hands are one group, too. Raises ValueError, one line, for a hand without geometry.
    """
    first = placed[0].hand
    root = ET.Element("robot", name=robot or first.prefix + first.name)
    for each in placed:
        _add(root, each)
    if len(placed) > 1:
        both = ET.SubElement(root, "group", name=HANDS)
        for each in placed:
            ET.SubElement(both, "group", name=each.group)
    return document(root, f"Made by: hand urdf, from {first.path.name} and the grasp patterns.")


def _add(root: ET.Element, placed: Placed) -> None:
    """The groups, states, end effector and pairs of links of one hand."""
    hand, grasps, mount, whole = placed.hand, placed.grasps, placed.mount, placed.group
    group = ET.SubElement(root, "group", name=whole)
    for joint in hand.joints:
        ET.SubElement(group, "joint", name=joint)
    for name, (tip, _) in fingers(hand).items():
        # A chain, because solvers of inverse kinematics need one.
        chain = {"base_link": hand.prefix + PALM, "tip_link": tip}
        ET.SubElement(ET.SubElement(root, "group", name=name), "chain", chain)
    for pattern, grasp in grasps.items():
        state = ET.SubElement(root, "group_state", name=pattern, group=whole)
        for joint, angle in zip(hand.joints, grasp.shape(1.0), strict=True):
            ET.SubElement(state, "joint", name=joint, value=number(angle))
    if mount:
        effector = {"name": whole, "parent_link": mount, "group": whole}
        ET.SubElement(root, "end_effector", effector)
    for first, second, reason in may_touch(hand):
        ET.SubElement(root, "disable_collisions", link1=first, link2=second, reason=reason)


def may_touch(hand: Hand) -> list[tuple[str, str, str]]:
    """Pairs of links whose collisions are not checked: neighbours, and those that overlap in the open hand."""
    links = geometry_of(hand).links
    poses = link_poses(hand, np.zeros(len(hand.joints)))
    pairs = []
    for index, first in enumerate(links):
        for second in links[index + 1 :]:
            if second.parent == first.name:
                pairs.append((first.name, second.name, "Adjacent"))
            elif _overlap(first, second, poses):
                pairs.append((first.name, second.name, "Default"))
    return pairs


def _overlap(first: Link, second: Link, poses: Mapping[str, Array]) -> bool:
    """Whether the bodies of two links overlap: their centre lines are closer than their half widths together."""
    lines = [_center_line(link, poses[link.name]) for link in (first, second)]
    distance = np.linalg.norm(lines[0][:, None] - lines[1][None], axis=-1).min()
    return bool(distance < (first.size_m[1] + second.size_m[1]) / 2.0) and "" not in (first.parent, second.parent)


def _center_line(link: Link, place: Array) -> Array:
    """Points (POINTS, 3) [m] from the joint of a link to its end."""
    along = np.linspace(0.0, link.size_m[0], POINTS)[:, None] * place[:3, 0]
    line: Array = place[:3, 3] + along
    return line
