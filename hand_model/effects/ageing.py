"""The stiffness drifts steadily."""

from __future__ import annotations

from hand_model.effects.effect import TIME, Effect
from hand_model.kernel.inline import inline, inlined
from hand_model.kernel.plant_rows import Parameter
from hand_model.statics import leverage

_leverage = inlined(leverage)


@inline
def torque(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """Eq. 11 with coefficients that change in proportion to time."""
    stiffness_per_s, strength_per_s, a1, a2, a3 = q
    elastic, strong = stiffness_per_s * e[TIME], strength_per_s * e[TIME]
    added = elastic * a1 * (phi - creep_angle) + strong * _leverage(phi, a2, a3) * p
    return added, -elastic * a1 - strong * a3 * p


EFFECT = Effect(
    name="ageing",
    place="material",
    parameters=(
        Parameter("ageing.stiffness_per_h", -60.0, 60.0, "relative change of elasticity per hour", 1 / 3600, 0.0, 3.0),
        Parameter(
            "ageing.strength_per_h", -60.0, 60.0, "relative change of pressure torque per hour", 1 / 3600, 0.0, 5.0
        ),
    ),
    reads=("statics.a1_nm_per_rad", "statics.a2_nm_per_pa", "statics.a3_nm_per_pa_rad"),
    hooks={"torque": torque},
    keys=("ageing.stiffness_per_h", "ageing.strength_per_h"),
    probes=((6.0, 0.0), (-6.0, 0.0), (0.0, -3.0), (0.0, 3.0)),
    says="the stiffness changes by {stiffness_per_h} and the strength by {strength_per_h}, both relative",
    experiments=("staircase", "hold"),
    doc="Softening or hardening of the silicone in use.",
    source="Mullins, Softening of Rubber by Deformation, 1969, far from its beginning",
)
