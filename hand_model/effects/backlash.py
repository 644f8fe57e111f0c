"""The measured angle follows the joint with play."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline, remember
from hand_model.plant_parameters import DEGREE, Parameter

(GAP,) = declare(Parameter("backlash.gap_deg", 0.0, 30.0, "whole gap", DEGREE, 0.0, 1.0))
PLAY = remember()


@inline
def angle_reading(w, i, phi, h):  # type: ignore[no-untyped-def]
    """Play operator between the actuator's angle and the measured one."""
    half = 0.5 * w[GAP, i]
    w[PLAY, i] = min(max(w[PLAY, i], phi - half), phi + half)
    return w[PLAY, i]


EFFECT = Effect(
    "backlash",
    "joint",
    ("backlash.gap_deg",),
    ((0.6,), (2.5,)),
    "there is a backlash of {gap_deg} degrees between actuator and sensor",
    ("slow_triangle", "reversals"),
    "Play: after each reversal the reading stands still until the gap is crossed.",
    "play operator, Nordin and Gutman, Automatica 38(10), 2002",
    {"angle_reading": angle_reading},
    starts=((PLAY, "angle"),),
)
