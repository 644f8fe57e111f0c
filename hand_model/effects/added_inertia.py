"""The moving part is heavier or lighter than modelled."""

from __future__ import annotations

from hand_model.effects.effect import Effect, Times

EFFECT = Effect(
    "added_inertia",
    "joint",
    ("dynamics.inertia_kg_m2",),
    ((Times(1.5),), (Times(3.0),), (Times(0.5),)),
    "the inertia is {inertia_kg_m2}",
    ("steps", "multisine"),
    "Inertia of the phalanx and of what it carries.",
    "Eq. 8, Martin et al. 2004",
)
