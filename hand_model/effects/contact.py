"""An obstacle stands in the way."""

from __future__ import annotations

from hand_model.effects.effect import Effect

EFFECT = Effect(
    "contact",
    "environment",
    ("contact.angle_deg", "contact.stiffness_nm_per_rad"),
    tuple((float(angle), 0.4) for angle in range(5, 100, 10)),
    "an obstacle begins at {angle_deg} with a stiffness of {stiffness_nm_per_rad}",
    ("slow_triangle", "staircase"),
    "A one-sided elastic obstacle in the direction of flexion.",
    "one-sided spring and damper, Hunt and Crossley, J. Appl. Mech. 42, 1975",
    spread={"contact.stiffness_nm_per_rad": 1.5},
    expected={"contact.angle_deg": 60.0},
    shape=("contact.angle_deg",),
)
