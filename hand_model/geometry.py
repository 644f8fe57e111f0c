"""The shape of a hand: its links, their masses and the frames on them, and where they are at given angles.

The palm's frame has its origin in the wrist. Its x axis points to the fingertips, its z axis out of the back of the
hand, its y axis of a right hand to the thumb. The frame of every other link has its origin on the axis of the joint
that moves the link; its x axis points along the link, its z axis to the back. A positive angle flexes, about +y for
every flexion joint. Lengths are in m, masses in kg, inertias in kg m^2, angles in rad; poses are homogeneous matrices
(4, 4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from hand_model.arrays import Array

if TYPE_CHECKING:
    from hand_model.description import Hand

PALM = "palm"
"""Name of the root link, before the prefix of the hand."""
MIDDLE_RAD = math.radians(45.0)
"""Angle of all joints at which the inertias of `dynamics` are those of the links [rad]."""
PLANAR = 0.01
"""Largest departure of two links from a motion in one plane, relative."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A body of a link. pose: (4, 4) of its middle in the frame of the link.

    size_m of a box: length, width, thickness along x, y, z; of a capsule: length of its cylinder along x, radius.
    """

    kind: Literal["box", "capsule"]
    size_m: tuple[float, ...]
    pose: Array


@dataclass(frozen=True, slots=True)
class Link:
    """A rigid body and the joint that moves it.

    name: of the link, prefix included.  parent: name of the link that carries it, "" for the palm.
    joint: index of the joint in the hand's order, -1 for the palm.  origin: (4, 4) frame of the joint, and of the link
    at angle 0, in the frame of the parent.  axis: (3,) unit vector of the joint in the frame of the link.
    size_m: length, width, thickness.  center_m: (3,) centre of mass in the frame of the link.  inertia_kg_m2: (3,)
    about the centre of mass and the axes of the link.
    """

    name: str
    parent: str
    joint: int
    origin: Array
    axis: Array
    size_m: tuple[float, float, float]
    mass_kg: float
    center_m: Array
    inertia_kg_m2: Array
    shapes: tuple[Shape, ...]


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame that is fixed on a link: a fingertip, or a force site whose z axis points out of the pad."""

    name: str
    link: str
    kind: Literal["fingertip", "force_site"]
    pose: Array


@dataclass(frozen=True, slots=True)
class Geometry:
    """All links, parents before their children and the palm first, and all frames on them."""

    side: Literal["right", "left"]
    links: tuple[Link, ...]
    frames: tuple[Frame, ...]


def link_name(joint: str) -> str:
    """Name of the link that a joint moves; both with the prefix of the hand."""
    return f"{joint}_link"


def frame_prefix(hand: Hand, namespace: str) -> str:
    """What precedes the names of frames on TF: nothing, or the namespace with a slash.

    A hand without a prefix outside the namespace `hand` gets its namespace, so that the frames of two hands differ.
    """
    space = namespace.strip("/")
    return "" if hand.prefix or space in ("", "hand") else f"{space}/"


def palm_frame(hand: Hand, namespace: str) -> str:
    """The frame_id of messages of a hand; "" for a hand without geometry, which has no frames."""
    return frame_prefix(hand, namespace) + hand.prefix + PALM if hand.geometry is not None else ""


def geometry_of(hand: Hand) -> Geometry:
    """The geometry of a hand. ValueError, one line, where its description has none."""
    if hand.geometry is None:
        raise ValueError(f"{hand.path}: geometry is missing; it must be a mapping of palm, links (docs/model.md)")
    return hand.geometry


def pose(position_m: Array, rotation: Array | None = None) -> Array:
    """A homogeneous matrix (4, 4) from a position (3,) [m] and a rotation (3, 3), none where it is left out."""
    matrix = np.eye(4)
    matrix[:3, 3] = position_m
    if rotation is not None:
        matrix[:3, :3] = rotation
    return matrix


def rotation_from_rpy(rpy_rad: Array) -> Array:
    """The rotation (3, 3) of roll, pitch and yaw (3,) [rad] about the fixed axes x, y, z, in this order, as in URDF."""
    roll, pitch, yaw = (rotation_about(axis, angle) for axis, angle in zip(np.eye(3), rpy_rad, strict=True))
    result: Array = yaw @ pitch @ roll
    return result


def rotation_about(axis: Array, angle_rad: Array | float) -> Array:
    """Rotations (..., 3, 3) by angles (...) [rad] about a unit vector (3,), by the formula of Rodrigues."""
    angle = np.asarray(angle_rad, dtype=np.float64)[..., None, None]
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    result: Array = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)
    return result


def link_poses(hand: Hand, angle_rad: Array) -> dict[str, Array]:
    """Poses (..., 4, 4) of every link, fingertip and force site in the frame of the palm, by name.

    angle_rad: (..., joints) in the hand's order; one pose of the hand or many. Raises ValueError, one line, for a hand
    without geometry or for another number of joints.
    """
    geometry = geometry_of(hand)
    angle = np.asarray(angle_rad, dtype=np.float64)
    count = len(hand.joints)
    if angle.ndim == 0 or angle.shape[-1] != count:
        raise ValueError(f"angle_rad has shape {angle.shape}; its last dimension must be {count}, one per joint")
    poses: dict[str, Array] = {}
    for link in geometry.links:
        if link.joint < 0:
            poses[link.name] = np.broadcast_to(link.origin, (*angle.shape[:-1], 4, 4)).copy()
            continue
        turn = np.zeros((*angle.shape[:-1], 4, 4))
        turn[..., :3, :3] = rotation_about(link.axis, angle[..., link.joint])
        turn[..., 3, 3] = 1.0
        poses[link.name] = poses[link.parent] @ (link.origin @ turn)
    for frame in geometry.frames:
        poses[frame.name] = poses[frame.link] @ frame.pose
    return poses


def mass_matrix(hand: Hand, angle_rad: Array) -> Array:
    """Inertias of the links about the joints, (joints, joints) [kg m^2], at angles (joints,) [rad].

    The sum of J_v^T m J_v + J_w^T I J_w over the links, with the Jacobians of the velocity of the centre of mass and of
    the rotation. It contains only the links: a moving part of an actuator adds to `dynamics.inertia_kg_m2` alone.
    """
    poses, count = link_poses(hand, angle_rad), len(hand.joints)
    links = {link.name: link for link in geometry_of(hand).links}
    total = np.zeros((count, count))
    for link in links.values():
        linear, angular = np.zeros((3, count)), np.zeros((3, count))
        place = poses[link.name]
        center = place[:3, :3] @ link.center_m + place[:3, 3]
        moved = link
        while moved.joint >= 0:
            frame = poses[moved.name]
            angular[:, moved.joint] = frame[:3, :3] @ moved.axis
            linear[:, moved.joint] = np.cross(angular[:, moved.joint], center - frame[:3, 3])
            moved = links[moved.parent]
        inertia = place[:3, :3] @ np.diag(link.inertia_kg_m2) @ place[:3, :3].T
        total += link.mass_kg * linear.T @ linear + angular.T @ inertia @ angular
    return total


def bending_inertia(hand: Hand, proximal: int, distal: int) -> float:
    """The part h [kg m^2] of the inertia of two phalanges that changes with the angle x of the distal one.

    About the proximal joint it is 2 h cos(x), and h cos(x) between both; h is the mass of the distal link times the
    length of the proximal one times the distance of its centre of mass from the distal joint (double pendulum,
    Goldstein, Classical Mechanics, 2002). 0 where both do not move in one plane, or for the indices in
    the other order.
    """
    straight, bent = (np.full(len(hand.joints), MIDDLE_RAD) for _ in range(2))
    straight[distal], bent[distal] = 0.0, 0.5 * math.pi
    change = mass_matrix(hand, straight) - mass_matrix(hand, bent)
    h = float(change[proximal, distal])
    planar = abs(change[proximal, proximal] - 2.0 * h) + abs(change[distal, distal]) <= PLANAR * abs(h)
    return h if planar else 0.0
