"""A neighbouring joint pulls this one along."""

from __future__ import annotations

from hand_model.effects.effect import NEIGHBOUR, Effect, declare, inline
from hand_model.plant_parameters import Parameter

STIFFNESS, RATIO, SOFTENING = declare(
    Parameter("joint_coupling.stiffness_nm_per_rad", -5.0, 5.0, "torque per angle of the neighbour", 1.0, 0.0, 0.01),
    Parameter("joint_coupling.ratio", 0.0, 3.0, "of its own angle that relieves it", 1.0, 0.0, 0.3),
    Parameter("joint_coupling.softening", -1.0, 1.0, "share of the pull lost at 1 rad", 1.0, 0.0, 0.1),
)


@inline
def torque(w, i, phi, omega, p, e):  # type: ignore[no-untyped-def]
    """A spring from the neighbour to this joint, whose arm may change with the angle."""
    x = e[NEIGHBOUR] - w[RATIO, i] * phi
    square = w[SOFTENING, i] * x * x
    return w[STIFFNESS, i] * (1.0 - square) * x, w[STIFFNESS, i] * w[RATIO, i] * (1.0 - 3.0 * square)


EFFECT = Effect(
    "joint_coupling",
    "joint",
    ("joint_coupling.stiffness_nm_per_rad", "joint_coupling.ratio", "joint_coupling.softening"),
    ((0.01, 0.0, 0.0), (-0.01, 0.0, 0.0)),
    "a neighbouring joint pulls with a stiffness of {stiffness_nm_per_rad}",
    ("neighbour_moves",),
    "Skin, tubes or tendons that span two joints.",
    "spring between two joints, the next term of its arm's series",
    {"torque": torque},
    shape=("joint_coupling.ratio", "joint_coupling.softening"),
)
