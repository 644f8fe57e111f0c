"""The static curve depends on the direction from which it is reached, at any speed."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline, remember
from hand_model.plant_parameters import DEGREE, Parameter

TORQUE, SCALE = declare(
    Parameter("hysteresis.torque_nm", 0.0, 1.0, "half the height of the loop", 1.0, 0.0, 0.01),
    Parameter("hysteresis.scale_deg", 1.0, 60.0, "motion after which the loop is closed to 1/e", DEGREE, 8.0, 6.0),
)
LOOP = remember()


@inline
def torque(w, i, phi, omega, p, e):  # type: ignore[no-untyped-def]
    """Dahl's loop: a torque against the motion that needs an angle to build up."""
    z = w[LOOP, i]
    toward = min(max(omega * 1e6, -1.0), 1.0)
    return -w[TORQUE, i] * z, w[TORQUE, i] / w[SCALE, i] * (1.0 - z * toward)


@inline
def moved(w, i, before, after, h):  # type: ignore[no-untyped-def]
    """dz = (sign - z) |dphi| / scale, taken implicitly."""
    way = abs(after - before) / w[SCALE, i]
    toward = 1.0 if after > before else -1.0
    w[LOOP, i] = (w[LOOP, i] + way * toward) / (1.0 + way)
    return 0.0


EFFECT = Effect(
    "hysteresis",
    "material",
    ("hysteresis.torque_nm", "hysteresis.scale_deg"),
    ((0.01, 4.0), (0.01, 12.0), (0.01, 30.0)),
    "the static curve has a loop of {torque_nm} N m on either side, built up over {scale_deg} degrees",
    ("slow_triangle", "reversals"),
    "Rate-independent hysteresis of elastomer and fabric.",
    "Dahl, A Solid Friction Model, 1968; the exponential special case of Bouc and Wen",
    {"torque": torque, "moved": moved},
    shape=("hysteresis.scale_deg",),
)
