"""A neighbouring joint pulls this one along."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import NEIGHBOUR, Effect
from hand_model.effects.force_curves import steeper
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import DEGREE, Parameter

DIFFERENCES_RAD = (0.1, 0.3, 1.0)
"""Differences of the angles beyond the gap between which the slope of the law changes."""


@inline
def torque(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """A spring from the neighbour to this joint, whose arm may change with the angle.

    By the law it is slack over a gap on either side, and beyond it steeper or flatter by shares at some differences of
    the angles: a skin that is loose at first, a string that pulls one way, or harder the further.
    """
    stiffness, ratio, softening, ahead_gap, behind_gap = q[:5]
    apart = e[NEIGHBOUR] - ratio * phi
    ahead, behind = max(apart - ahead_gap, 0.0), max(-apart - behind_gap, 0.0)
    x = ahead - behind
    square = softening * x * x
    gained, ahead_slope = steeper(ahead, DIFFERENCES_RAD, q[5:9])
    lost, behind_slope = steeper(behind, DIFFERENCES_RAD, q[9:13])
    slope = 1.0 - 3.0 * square + (ahead_slope if x > 0.0 else behind_slope)
    slack = apart < ahead_gap and -apart < behind_gap
    return stiffness * ((1.0 - square) * x + (gained - lost)), 0.0 if slack else stiffness * ratio * slope


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Torque [N m] where the neighbour is ahead by x [rad]."""
    around = (0.0,) * NEIGHBOUR + (x,)
    return float(torque(q, 0.0, 0.0, 0.0, 0.0, around)[0])


_WHERE = ("where it begins", *(f"at {node:g} rad" for node in DIFFERENCES_RAD))
_LAW = tuple(
    Parameter(f"joint_coupling.{side}_gap_deg", 0.0, 180.0, f"law: slack, neighbour {side}", DEGREE, 0.0, 5.0, law=True)
    for side in ("ahead", "behind")
) + tuple(
    Parameter(f"joint_coupling.{side}_{k}", -1.0, 50.0, f"law: share steeper {where}", 1.0, 0.0, 1.0, law=True)
    for side in ("ahead", "behind")
    for k, where in enumerate(_WHERE, 1)
)
EFFECT = Effect(
    name="joint_coupling",
    place="joint",
    needs=("other_joint",),
    parameters=(
        Parameter("joint_coupling.stiffness_nm_per_rad", -5.0, 5.0, "torque per neighbour's angle", 1.0, 0.0, 0.01),
        Parameter("joint_coupling.ratio", 0.0, 3.0, "of its own angle that relieves it", 1.0, 0.0, 0.3),
        Parameter("joint_coupling.softening", -1.0, 1.0, "share of the pull lost at 1 rad", 1.0, 0.0, 0.1),
        *_LAW,
    ),
    hooks={"torque": torque},
    keys=("joint_coupling.stiffness_nm_per_rad", "joint_coupling.ratio", "joint_coupling.softening"),
    probes=((0.01, 0.0, 0.0), (-0.01, 0.0, 0.0), (0.01, 1.0, 0.0), (-0.01, 1.0, 0.0)),
    shape=("joint_coupling.ratio", "joint_coupling.softening"),
    says="a neighbouring joint pulls with a stiffness of {stiffness_nm_per_rad}",
    experiments=("neighbour_moves",),
    doc="Skin, tubes or tendons that span two joints.",
    source="spring between two joints, the next term of its arm's series",
    meets_others=True,
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="towards the neighbour's motion",
        passive=True,
        monotone="rises with the difference of the angles, in proportion to it by the textbook",
        over=("angle difference",),
        coefficients=tuple(parameter.key for parameter in _LAW),
        quantity="the {torque} of the coupling",
        unit="nm",
        curve=curve,
        source="Betti's reciprocity of elastic structures; an elastic string pulls and does not push",
    ),
)
