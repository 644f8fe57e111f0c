"""A stop is softer or nearer than modelled."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect, Times

EFFECT = Effect(
    name="end_stop",
    place="joint",
    keys=(
        "end_stop.high_deg",
        "end_stop.low_deg",
        "end_stop.stiffness_nm_per_rad",
        "end_stop.damping_nm_s_per_rad",
    ),
    probes=(
        (85.0, Times(1.0), 1.0, Times(1.0)),
        (70.0, Times(1.0), 1.0, Times(1.0)),
        (55.0, Times(1.0), 1.0, Times(1.0)),
        (Times(1.0), 0.0, 1.0, Times(1.0)),
        (Times(1.0), 10.0, 1.0, Times(1.0)),
    ),
    spread={"end_stop.stiffness_nm_per_rad": 1.5, "end_stop.damping_nm_s_per_rad": 1.5},
    lasting=True,
    alike=("contact",),
    shape=("end_stop.high_deg", "end_stop.low_deg"),
    says="the end stops begin at {low_deg} and {high_deg} with a stiffness of {stiffness_nm_per_rad}",
    experiments=("staircase", "slow_triangle"),
    doc="Range of motion of the joint, with an elastic stop at both ends, at a fixed angle and all the time.",
    source="one-sided spring and damper, Hunt and Crossley, J. Appl. Mech. 42, 1975",
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="pushes back into the range",
        passive=True,
        monotone="rises with the depth; a stop never pulls",
        over=("angle", "speed"),
        source="Hunt and Crossley, J. Appl. Mech. 42, 1975",
    ),
)
