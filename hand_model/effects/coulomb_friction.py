"""Dry friction, with Stribeck breakaway and a part that grows with the pressure."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline
from hand_model.plant_parameters import Parameter

TORQUE, BREAKAWAY, SPEED, LOADED = declare(
    Parameter("coulomb_friction.torque_nm", 0.0, 5.0, "at speed", 1.0, 0.0, 0.005),
    Parameter("coulomb_friction.breakaway_nm", 0.0, 5.0, "more of it at rest", 1.0, 0.0, 0.003),
    Parameter("coulomb_friction.stribeck_rad_per_s", 1e-3, 10.0, "speed at which half of that is gone", 1.0, 0.1),
    Parameter("coulomb_friction.torque_nm_per_pa", 0.0, 1e-5, "more of it with pressure", 1.0, 0.0, 1e-8),
)


@inline
def dry(w, i, omega, p):  # type: ignore[no-untyped-def]
    """Magnitude of the friction torque at a speed; the chain lets it stick."""
    x = omega / w[SPEED, i]
    return w[TORQUE, i] + w[BREAKAWAY, i] / (1.0 + x * x) + w[LOADED, i] * max(p, 0.0)


EFFECT = Effect(
    "coulomb_friction",
    "joint",
    ("coulomb_friction.torque_nm", "coulomb_friction.breakaway_nm", "coulomb_friction.torque_nm_per_pa"),
    ((0.004, 0.0, 0.0), (0.015, 0.0, 0.0), (0.003, 0.006, 0.0), (0.0, 0.0, 3e-8)),
    "Coulomb friction of {torque_nm} N m is missing (with {breakaway_nm} N m more to break away and"
    " {torque_nm_per_pa} N m/Pa more under pressure)",
    ("slow_triangle", "reversals"),
    "Dry friction lets the joint stick and lag after reversals by the same torque at any speed.",
    "Coulomb 1785; Stribeck 1902; Armstrong-Helouvry et al., Automatica 30(7), 1994",
    {"dry": dry},
)
