"""Two phalanges of a finger as two rigid links, whose inertia changes with the angle between them.

Eq. 8 has constant inertias, those at MIDDLE_RAD. With the links of `geometry` the torques that it lacks are, of the
proximal joint p and the distal one d, with c = cos(x_d) - cos(MIDDLE_RAD), s = sin(x_d) and h of `bending_inertia`,

    proximal: -2 h c x_p'' - h c x_d'' + h s (2 x_p' x_d' + x_d'^2)        distal: -h c x_p'' - h s x_p'^2

(Lagrange's equations of a double pendulum; Goldstein, Classical Mechanics, 2002). They have no free number. The model
of a joint meets its partner only through the partner's acceleration, so they are given as a part of it: divided by the
coupling inertia, with the opposite sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hand_identification.driving import accelerations, speeds
from hand_identification.free_parameters import FreeParameter
from hand_identification.joint_problem import JointProblem
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.geometry import MIDDLE_RAD, bending_inertia
from hand_model.joint_model import JointModel
from hand_model.kernel.rows import ROW

_COUPLING = ROW["dynamics.coupling_inertia_kg_m2"]


@dataclass(frozen=True, slots=True)
class Motion:
    """Angle [rad], speed [rad/s] and acceleration [rad/s^2] of a joint in one segment, (T,) each."""

    angle: Array
    speed: Array
    acceleration: Array


def motions(problem: JointProblem, free: Sequence[FreeParameter], z: Array) -> list[Motion]:
    """The motion in every segment: that of the joint's model at coordinates z (free,) [-] and its smoothed residual."""
    moved = zip(problem.segments, speeds(problem, free, z), accelerations(problem, free, z), strict=True)
    return [Motion(segment.angle_rad, speed, acceleration) for segment, speed, acceleration in moved]


def linked(model: JointModel, joint: int) -> tuple[float, bool]:
    """h / J_c [-] of a joint and its partner, and whether the joint is the proximal one.

    0 for a joint without partner or coupling inertia, of a description without links, or of links that do not move in
    one plane.
    """
    other, coupling = int(model.partner[joint]), float(model.parameters[_COUPLING, joint])
    if not isinstance(model, Hand) or model.geometry is None or other < 0 or coupling <= 0.0:
        return 0.0, False
    own, theirs = bending_inertia(model, joint, other), bending_inertia(model, other, joint)
    return (own or theirs) / coupling, own != 0.0


def bending(share: float, own: Motion, other: Motion, *, proximal: bool) -> Array:
    """What the changing inertia adds to the acceleration (T,) [rad/s^2] of a joint's partner; see above.

    share: h / J_c [-].  own, other: of the joint and of its partner.  proximal: whether the joint is the proximal one.
    """
    x = other.angle if proximal else own.angle
    c, s = np.cos(x) - np.cos(MIDDLE_RAD), np.sin(x)
    if proximal:
        turning = other.speed * (2.0 * own.speed + other.speed)
        return np.asarray(share * (c * (2.0 * own.acceleration + other.acceleration) - s * turning))
    return np.asarray(share * (c * other.acceleration + s * other.speed**2))
