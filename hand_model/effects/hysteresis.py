"""The static curve depends on the direction from which it is reached, at any speed."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline, remember
from hand_model.plant_parameters import DEGREE, Parameter

TORQUE, SCALE, SHARPNESS = declare(
    Parameter("hysteresis.torque_nm", 0.0, 1.0, "half the height of the loop", 1.0, 0.0, 0.01),
    Parameter("hysteresis.scale_deg", 2.0, 60.0, "motion after which the loop is closed to 1/e", DEGREE, 8.0, 6.0),
    Parameter("hysteresis.sharpness", 0.0, 1.0, "0 a rounded loop, 1 one with a knee", 1.0, 0.0, 0.17),
)
LOOP = remember()


@inline
def _building(a, sharp):  # type: ignore[no-untyped-def]
    """Growth of the loop per motion over its scale; a: how far it is built up in the direction of motion, -1 ... 1."""
    forward = max(a, 0.0)
    return 1.0 - (1.0 - sharp) * a - sharp * forward * forward


@inline
def torque(w, i, phi, omega, p, e):  # type: ignore[no-untyped-def]
    """Dahl's loop, or Bouc and Wen's: a torque against the motion that needs an angle to build up."""
    z = w[LOOP, i]
    toward = min(max(omega * 1e6, -1.0), 1.0)
    return -w[TORQUE, i] * z, w[TORQUE, i] / w[SCALE, i] * _building(z * toward, w[SHARPNESS, i])


@inline
def moved(w, i, before, after, h):  # type: ignore[no-untyped-def]
    """The loop's growth, taken implicitly (linearised)."""
    way = abs(after - before) / w[SCALE, i]
    toward = 1.0 if after > before else -1.0
    a, sharp = w[LOOP, i] * toward, w[SHARPNESS, i]
    slower = (1.0 - sharp) + 2.0 * sharp * max(a, 0.0)
    w[LOOP, i] = toward * min(a + way * _building(a, sharp) / (1.0 + way * slower), 1.0)
    return 0.0


EFFECT = Effect(
    "hysteresis",
    "material",
    ("hysteresis.torque_nm", "hysteresis.scale_deg", "hysteresis.sharpness"),
    ((0.01, 4.0, 0.0), (0.01, 12.0, 0.0), (0.01, 30.0, 0.0), (0.01, 8.0, 1.0)),
    "the static curve has a loop of {torque_nm} N m on either side, built up over {scale_deg} degrees",
    ("slow_triangle", "reversals"),
    "Rate-independent hysteresis of elastomer and fabric.",
    "Dahl, A Solid Friction Model, 1968; Wen, J. Eng. Mech. 102(2), 1976, of the second power where sharp",
    {"torque": torque, "moved": moved},
    shape=("hysteresis.scale_deg", "hysteresis.sharpness"),
)
