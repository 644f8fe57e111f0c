"""A constant torque acts on the joint."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect

EFFECT = Effect(
    name="constant_load",
    place="environment",
    keys=("constant_load.torque_nm",),
    probes=((0.01,), (-0.01,)),
    says="a constant load of {torque_nm} resists {flexion}",
    experiments=("second_attitude", "staircase"),
    doc="The disturbance torque of Eq. 8 as a constant.",
    source="Eq. 8, Martin et al. 2004",
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="either",
        passive=True,
        monotone="constant",
        over=(),
        source="Eq. 8, Martin et al. 2004",
    ),
)
