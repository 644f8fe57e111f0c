"""The measured angle follows the joint with play."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, followed, inline, remember
from hand_model.plant_parameters import DEGREE, Parameter

GAP, LAG = declare(
    Parameter("backlash.gap_deg", 0.0, 30.0, "whole gap", DEGREE, 0.0, 1.0),
    Parameter("backlash.contact_time_s", 0.0, 0.1, "in which the driven side follows at the gap's end", 1.0, 0.0, 2e-3),
)
PLAY, BEFORE = remember(), remember()


@inline
def _pushed(link, phi, half):  # type: ignore[no-untyped-def]
    return min(max(link, phi - half), phi + half)


@inline
def angle_reading(w, i, phi, h):  # type: ignore[no-untyped-def]
    """Play operator between the actuator's angle and the measured one; at its ends a soft contact."""
    half, link = 0.5 * w[GAP, i], w[PLAY, i]
    w[PLAY, i] = followed(link, _pushed(link, w[BEFORE, i], half), _pushed(link, phi, half), w[LAG, i], h)
    w[BEFORE, i] = phi
    return w[PLAY, i]


EFFECT = Effect(
    "backlash",
    "joint",
    ("backlash.gap_deg", "backlash.contact_time_s"),
    ((0.6, 0.0), (2.5, 0.0)),
    "there is a backlash of {gap_deg} between actuator and sensor",
    ("slow_triangle", "reversals"),
    "Play: after each reversal the reading stands still until the gap is crossed.",
    "play operator and damped contact, Nordin and Gutman, Automatica 38(10), 2002",
    {"angle_reading": angle_reading},
    starts=((PLAY, "angle"), (BEFORE, "angle")),
    shape=("backlash.contact_time_s",),
)
