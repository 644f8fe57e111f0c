"""A constant torque acts on the joint."""

from __future__ import annotations

from hand_model.effects.effect import Effect

EFFECT = Effect(
    "constant_load",
    "environment",
    ("constant_load.torque_nm",),
    ((0.01,), (-0.01,)),
    "a constant load of {torque_nm} resists {flexion}",
    ("second_attitude", "staircase"),
    "The disturbance torque of Eq. 8 as a constant.",
    "Eq. 8, Martin et al. 2004",
)
