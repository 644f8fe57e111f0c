"""The valve begins to answer later than its model."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect

EFFECT = Effect(
    name="valve_delay",
    place="valve",
    needs=("valve",),
    keys=("valve.dead_time_s",),
    probes=((0.015,), (0.03,), (0.0,)),
    says="the valve reacts after a dead time of {dead_time_s}",
    experiments=("steps", "multisine"),
    doc="Dead time between a set-point and the first change of pressure.",
    source="Martin et al. 2004, Sec. 3.3",
    constitution=Constitution(
        acts_on="set-point that reaches the valve",
        sign="late",
        monotone="a shift in time",
        memory="the set-points of the dead time",
        over=("time",),
        source="pure transport delay, Ljung, System Identification, 1999",
    ),
)
