"""An obstacle stands in the way of flexion."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect

EFFECT = Effect(
    name="contact",
    place="environment",
    keys=("contact.angle_deg", "contact.stiffness_nm_per_rad", "contact.damping_nm_s_per_rad"),
    probes=tuple((float(angle), 0.4, 3e-4) for angle in range(5, 100, 10)),
    spread={"contact.stiffness_nm_per_rad": 2.3, "contact.damping_nm_s_per_rad": 1.5},
    expected={"contact.angle_deg": 60.0, "contact.damping_nm_s_per_rad": 0.02},
    shape=("contact.angle_deg",),
    alike=("end_stop",),
    says="an obstacle begins at {angle_deg} with a stiffness of {stiffness_nm_per_rad}",
    experiments=("slow_triangle", "staircase", "free_space"),
    doc="A one-sided elastic obstacle in the direction of flexion, soft or hard, at any angle; it may come and go.",
    source="one-sided spring and damper, Hunt and Crossley, J. Appl. Mech. 42, 1975",
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="pushes away from the obstacle",
        passive=True,
        monotone="rises with the depth; an obstacle never pulls",
        over=("angle", "speed"),
        source="Hunt and Crossley, J. Appl. Mech. 42, 1975",
    ),
)
