"""The static curve depends on the direction from which it is reached, at any speed."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline, loop_moved, loop_torque, remember
from hand_model.plant_parameters import DEGREE, Parameter

TORQUE, SCALE, SHARPNESS = declare(
    Parameter("hysteresis.torque_nm", 0.0, 1.0, "half the height of the loop", 1.0, 0.0, 0.01),
    Parameter("hysteresis.scale_deg", 2.0, 60.0, "motion after which the loop is closed to 1/e", DEGREE, 8.0, 6.0),
    Parameter("hysteresis.sharpness", 0.0, 1.0, "0 a rounded loop, 1 one with a knee", 1.0, 0.0, 0.17),
)
LOOP = remember()


@inline
def torque(w, i, phi, omega, p, e):  # type: ignore[no-untyped-def]
    """Dahl's loop, or Bouc and Wen's: a torque against the motion that needs an angle to build up."""
    share, stiffness = loop_torque(w[LOOP, i], omega, w[SCALE, i], w[SHARPNESS, i])
    return w[TORQUE, i] * share, w[TORQUE, i] * stiffness


@inline
def moved(w, i, before, after, h):  # type: ignore[no-untyped-def]
    """The loop follows the motion."""
    w[LOOP, i] = loop_moved(w[LOOP, i], before, after, w[SCALE, i], w[SHARPNESS, i])
    return 0.0


EFFECT = Effect(
    "hysteresis",
    "material",
    ("hysteresis.torque_nm", "hysteresis.scale_deg", "hysteresis.sharpness"),
    ((0.01, 4.0, 0.0), (0.01, 12.0, 0.0), (0.01, 30.0, 0.0), (0.01, 8.0, 1.0)),
    "the static curve has a hysteresis loop of {torque_nm} on either side, built up over {scale_deg}",
    ("slow_triangle", "reversals"),
    "Rate-independent hysteresis of elastomer and fabric.",
    "Dahl, A Solid Friction Model, 1968; Wen, J. Eng. Mech. 102(2), 1976, of the second power where sharp",
    {"torque": torque, "moved": moved},
    shape=("hysteresis.scale_deg", "hysteresis.sharpness"),
)
