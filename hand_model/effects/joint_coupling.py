"""A neighbouring joint pulls this one along."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import NEIGHBOUR, Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def torque(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """A spring from the neighbour to this joint, whose arm may change with the angle."""
    stiffness, ratio, softening = q
    x = e[NEIGHBOUR] - ratio * phi
    square = softening * x * x
    return stiffness * (1.0 - square) * x, stiffness * ratio * (1.0 - 3.0 * square)


EFFECT = Effect(
    name="joint_coupling",
    place="joint",
    needs=("other_joint",),
    parameters=(
        Parameter("joint_coupling.stiffness_nm_per_rad", -5.0, 5.0, "torque per neighbour's angle", 1.0, 0.0, 0.01),
        Parameter("joint_coupling.ratio", 0.0, 3.0, "of its own angle that relieves it", 1.0, 0.0, 0.3),
        Parameter("joint_coupling.softening", -1.0, 1.0, "share of the pull lost at 1 rad", 1.0, 0.0, 0.1),
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
        monotone="in proportion to the difference of the angles",
        over=("angle",),
        source="Betti's reciprocity of elastic structures",
    ),
)
