"""A neighbouring joint pulls this one along."""

from __future__ import annotations

from hand_model.effects.effect import NEIGHBOUR, Effect, declare, inline
from hand_model.plant_parameters import Parameter

STIFFNESS, DRAG = declare(
    Parameter("joint_coupling.stiffness_nm_per_rad", -5.0, 5.0, "torque per angle of the neighbour", 1.0, 0.0, 0.01),
    Parameter("joint_coupling.own_nm_per_rad", -5.0, 5.0, "torque per angle of its own", 1.0, 0.0, 0.003),
)


@inline
def torque(w, i, phi, omega, p, e):  # type: ignore[no-untyped-def]
    """A spring from the neighbour to this joint."""
    return w[STIFFNESS, i] * e[NEIGHBOUR] - w[DRAG, i] * phi, w[DRAG, i]


EFFECT = Effect(
    "joint_coupling",
    "joint",
    ("joint_coupling.stiffness_nm_per_rad", "joint_coupling.own_nm_per_rad"),
    ((0.01, 0.0), (-0.01, 0.0)),
    "a neighbouring joint pulls with {stiffness_nm_per_rad} N m/rad",
    ("neighbour_moves",),
    "Skin, tubes or tendons that span two joints.",
    "linear spring between two joints",
    {"torque": torque},
)
