"""Damping of another size than modelled, or growing with the square of the speed."""

from __future__ import annotations

from hand_model.effects.effect import Effect, Times, declare, inline
from hand_model.plant_parameters import Parameter

(QUADRATIC,) = declare(
    Parameter("viscous_friction.quadratic_nm_s2_per_rad2", 0.0, 1.0, "torque per squared speed", 1.0, 0.0, 1e-3)
)


@inline
def damping(w, i, omega):  # type: ignore[no-untyped-def]
    """Damping added by the quadratic part."""
    return w[QUADRATIC, i] * abs(omega)


EFFECT = Effect(
    "viscous_friction",
    "joint",
    ("dynamics.viscous_friction_nm_s_per_rad", "viscous_friction.quadratic_nm_s2_per_rad2"),
    ((Times(1.5), 0.0), (Times(0.6), 0.0), (Times(3.0), 0.0), (Times(1.0), 1e-3)),
    "viscous friction is {viscous_friction_nm_s_per_rad}, with {quadratic_nm_s2_per_rad2} more at speed",
    ("steps", "multisine"),
    "Linear damping that differs from the nominal one, and drag.",
    "Eq. 8, Martin et al. 2004; quadratic drag",
    {"damping": damping},
)
