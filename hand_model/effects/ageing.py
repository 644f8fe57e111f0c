"""The stiffness drifts steadily."""

from __future__ import annotations

from hand_model.effects.effect import CREPT, TIME, Effect, declare, inline
from hand_model.plant_parameters import PLANT_ROW, Parameter

STIFFNESS, STRENGTH = declare(
    Parameter("ageing.stiffness_per_h", -60.0, 60.0, "relative change of the elasticity an hour", 1 / 3600, 0.0, 3.0),
    Parameter(
        "ageing.strength_per_h", -60.0, 60.0, "relative change of the pressure torque an hour", 1 / 3600, 0.0, 5.0
    ),
)
_A1, _A2, _A3 = (PLANT_ROW[f"statics.{key}"] for key in ("a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad"))


@inline
def torque(w, i, phi, omega, p, e):  # type: ignore[no-untyped-def]
    """Eq. 11 with coefficients that change in proportion to time."""
    t = e[TIME]
    elastic, strong = w[STIFFNESS, i] * t, w[STRENGTH, i] * t
    added = elastic * w[_A1, i] * (phi - w[CREPT, i]) + strong * (w[_A2, i] + w[_A3, i] * phi) * p
    return added, -elastic * w[_A1, i] - strong * w[_A3, i] * p


EFFECT = Effect(
    "ageing",
    "material",
    ("ageing.stiffness_per_h", "ageing.strength_per_h"),
    ((6.0, 0.0), (-6.0, 0.0), (0.0, -3.0), (0.0, 3.0)),
    "the stiffness changes by {stiffness_per_h} and the strength by {strength_per_h}, both relative",
    ("staircase", "hold"),
    "Softening or hardening of the silicone in use.",
    "Mullins, Softening of Rubber by Deformation, 1969, far from its beginning",
    {"torque": torque},
)
