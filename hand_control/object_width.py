"""How wide a held object is: the distance of two opposed pads in contact, from the angles and the shape of the hand."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import combinations

import numpy as np

from hand_model.arrays import Array, Flags
from hand_model.description import Hand
from hand_model.geometry import Link, link_name, link_poses


def object_width_m(hand: Hand, position_rad: Array, contact: Flags) -> float:
    """Smallest distance [m] of two opposed pads; NaN where none are in contact, or the hand has no geometry.

    position_rad: (joints,).  contact: (joints,) joints that an object holds. A pad is the middle of the side of a link
    that faces the palm. Two pads of different fingers are opposed if each lies in front of the other one.
    """
    if hand.geometry is None or np.count_nonzero(contact) < 2:
        return math.nan
    poses = link_poses(hand, position_rad)
    links = {link.name: link for link in hand.geometry.links}
    pads = []
    for joint in np.flatnonzero(contact):
        name = link_name(hand.joints[joint])
        if name in poses:
            length, _, thickness = links[name].size_m
            at = poses[name] @ np.array([0.5 * length, 0.0, -0.5 * thickness, 1.0])
            pads.append((_finger(links, name), at[:3], -poses[name][:3, 2]))
    widths = [
        float(np.linalg.norm(there - here))
        for (finger, here, out), (other, there, back) in combinations(pads, 2)
        if finger != other and (there - here) @ out > 0.0 and (here - there) @ back > 0.0
    ]
    return min(widths, default=math.nan)


def _finger(links: Mapping[str, Link], name: str) -> str:
    """Name of the first link of the finger that a link belongs to; the palm carries it."""
    while links[links[name].parent].parent:
        name = links[name].parent
    return name
