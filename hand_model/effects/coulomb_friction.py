"""Dry friction, with Stribeck breakaway, a part that grows with the pressure, and contacts that give a little first."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline, loop_moved, loop_torque, remember
from hand_model.plant_parameters import DEGREE, Parameter

TORQUE, BREAKAWAY, SPEED, LOADED, PRESLIDING = declare(
    Parameter("coulomb_friction.torque_nm", 0.0, 5.0, "at speed", 1.0, 0.0, 0.005),
    Parameter("coulomb_friction.breakaway_nm", 0.0, 5.0, "more of it at rest", 1.0, 0.0, 0.003),
    Parameter("coulomb_friction.stribeck_rad_per_s", 1e-3, 10.0, "speed at which half of that is gone", 1.0, 0.1),
    Parameter("coulomb_friction.torque_nm_per_pa", 0.0, 1e-5, "more of it with pressure", 1.0, 0.0, 1e-8),
    Parameter(
        "coulomb_friction.presliding_deg", 0.01, 1.0, "motion that builds it up to 1 - 1/e; rigid at 0.02",
        DEGREE, 0.01,
    ),
)  # fmt: skip
RIGID_RAD, GIVING_RAD = 0.02 * DEGREE, 0.05 * DEGREE
"""Up to the first the contacts are rigid, from the second on they give; between, they do so in part."""
BRISTLE = remember()


@inline
def level(w, i, omega, p):  # type: ignore[no-untyped-def]
    """Friction torque of a sliding joint, its magnitude [N m]."""
    x = omega / w[SPEED, i]
    return w[TORQUE, i] + w[BREAKAWAY, i] / (1.0 + x * x) + w[LOADED, i] * max(p, 0.0)


@inline
def giving(w, i):  # type: ignore[no-untyped-def]
    """Share of the friction whose contacts give."""
    return min(max((w[PRESLIDING, i] - RIGID_RAD) * (1.0 / (GIVING_RAD - RIGID_RAD)), 0.0), 1.0)


@inline
def dry(w, i, omega, p):  # type: ignore[no-untyped-def]
    """Magnitude of the friction torque of rigid contacts; the chain lets it stick."""
    return level(w, i, omega, p) * (1.0 - giving(w, i))


@inline
def torque(w, i, phi, omega, p, e):  # type: ignore[no-untyped-def]
    """Torque of contacts that give, against the motion so far."""
    whole = level(w, i, omega, p) * giving(w, i)
    share, stiffness = loop_torque(w[BRISTLE, i], omega, w[PRESLIDING, i], 0.0)
    return whole * share, whole * stiffness


@inline
def moved(w, i, before, after, h):  # type: ignore[no-untyped-def]
    """Dahl's loop over the presliding motion."""
    w[BRISTLE, i] = loop_moved(w[BRISTLE, i], before, after, w[PRESLIDING, i], 0.0)
    return 0.0


EFFECT = Effect(
    "coulomb_friction",
    "joint",
    (
        "coulomb_friction.torque_nm",
        "coulomb_friction.breakaway_nm",
        "coulomb_friction.torque_nm_per_pa",
        "coulomb_friction.presliding_deg",
    ),
    (
        (0.004, 0.0, 0.0, 0.1),
        (0.004, 0.0, 0.0, 0.01),
        (0.015, 0.0, 0.0, 0.01),
        (0.003, 0.006, 0.0, 0.05),
        (0.0, 0.0, 3e-8, 0.01),
    ),
    "Coulomb friction of {torque_nm} is missing (plus {breakaway_nm} at breakaway and"
    " {torque_nm_per_pa} times the {pressure}, built up over {presliding_deg})",
    ("slow_triangle", "reversals"),
    "Dry friction lets the joint stick and lag after reversals by the same torque at any speed. Before it slides, its"
    " contacts give.",
    "Coulomb 1785; Stribeck 1902; Dahl 1968 before it slides; Armstrong-Helouvry et al., Automatica 30(7), 1994",
    {"dry": dry, "torque": torque, "moved": moved},
    spread={"coulomb_friction.presliding_deg": 1.0},
    expected={"coulomb_friction.presliding_deg": 0.05},
    shape=("coulomb_friction.presliding_deg",),
)
