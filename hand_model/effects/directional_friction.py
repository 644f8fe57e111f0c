"""Friction that is larger in one direction of motion than in the other: a part of its level, and a part of its drag."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.effects.operators import direction
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def dry(q, phi, omega, p):  # type: ignore[no-untyped-def]
    """Half of the level, in both directions; with `torque` it is all of it in one direction and none in the other."""
    return 0.5 * abs(q[0])


@inline
def torque(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """The other half: friction between 0 and a level is half of it either way, and half of it as a constant."""
    return -0.5 * q[0], 0.0


@inline
def damping(q, omega):  # type: ignore[no-untyped-def]
    """The drag of the direction in which there is more of it."""
    forward = 0.5 * (1.0 + direction(omega))
    return max(-q[1], 0.0) + q[1] * forward


EFFECT = Effect(
    name="directional_friction",
    place="joint",
    needs=("one_axis",),
    refines=("coulomb_friction", "viscous_friction"),
    parameters=(
        Parameter(
            "directional_friction.torque_nm", -5.0, 5.0, "more level forward; negative: more back", 1.0, 0.0, 0.005
        ),
        Parameter(
            "directional_friction.drag_nm_s_per_rad",
            -10.0,
            10.0,
            "more drag forward; negative: more back",
            1.0,
            0.0,
            2e-3,
        ),
    ),
    hooks={"dry": dry, "torque": torque, "damping": damping},
    keys=("directional_friction.torque_nm", "directional_friction.drag_nm_s_per_rad"),
    probes=((0.01, 0.0), (-0.01, 0.0), (0.0, 4e-3), (0.0, -4e-3), (0.0, 0.03), (0.0, -0.03)),
    says="friction against {flexion} is larger than back by {torque_nm} and {drag_nm_s_per_rad} times the speed"
    " (negative: smaller)",
    experiments=("slow_triangle", "steps"),
    doc="Level and drag of the friction differ between the directions of motion, as of lip seals, brushes and gears. A"
    " level alone acts as a constant load on an axis with dry friction.",
    source="Armstrong-Helouvry et al., Automatica 30(7), 1994, asymmetric friction",
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="against the motion, in one direction more than in the other",
        passive=True,
        monotone="constant and in proportion to the speed, in one direction",
        over=("direction", "speed"),
        source="Armstrong-Helouvry et al., Automatica 30(7), 1994; Janot et al., Control Eng. Practice 22, 2014",
    ),
)
