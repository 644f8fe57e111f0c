"""A spring that the model lacks, or one of another stiffness; a negative one pushes away from position 0."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def torque(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """Hooke's law, in addition to the elasticity of the plain plant."""
    return -q[0] * phi, q[0]


EFFECT = Effect(
    name="spring",
    place="joint",
    needs=("one_axis", "inexact_stiffness", "elastic_part"),
    parameters=(
        Parameter("spring.stiffness_nm_per_rad", -100.0, 100.0, "in addition; negative: pushes away", 1.0, 0.0, 0.03),
    ),
    hooks={"torque": torque},
    keys=("spring.stiffness_nm_per_rad",),
    probes=((0.02,), (-0.02,), (0.2,), (-0.04,)),
    says="a spring of {stiffness_nm_per_rad} acts in addition (negative: away from 0)",
    experiments=("staircase", "slow_triangle"),
    doc="A spring of either sign that the model lacks: of a cable, a seal, a magnet or an unstable balance.",
    source="Hooke 1678; Moon and Holmes, J. Sound Vib. 65(2), 1979, a spring of negative stiffness",
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="either; it has a potential",
        passive=True,
        monotone="in proportion to the angle",
        over=("angle",),
        source="Hooke's law",
    ),
)
