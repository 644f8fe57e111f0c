"""The moving part is heavier or lighter than modelled."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect, Times

EFFECT = Effect(
    name="added_inertia",
    place="joint",
    keys=("dynamics.inertia_kg_m2",),
    probes=((Times(1.5),), (Times(3.0),), (Times(0.5),)),
    says="the inertia is {inertia_kg_m2}",
    experiments=("steps", "multisine"),
    doc="Inertia of the phalanx and of what it carries.",
    source="Eq. 8, Martin et al. 2004",
    constitution=Constitution(
        acts_on="inertia of the joint",
        sign="positive",
        passive=True,
        monotone="torque in proportion to the acceleration",
        over=("acceleration",),
        source="positive definite mass matrix, Goldstein, Classical Mechanics, 2002",
    ),
)
