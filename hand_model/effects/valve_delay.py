"""The valve begins to answer later than its model."""

from __future__ import annotations

from hand_model.effects.effect import Effect

EFFECT = Effect(
    name="valve_delay",
    place="valve",
    keys=("valve.dead_time_s",),
    probes=((0.015,), (0.03,), (0.0,)),
    says="the valve reacts after a dead time of {dead_time_s}",
    experiments=("steps", "multisine"),
    doc="Dead time between a set-point and the first change of pressure.",
    source="Martin et al. 2004, Sec. 3.3",
)
