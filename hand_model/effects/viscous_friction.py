"""Damping of another size than modelled, or growing with the square of the speed."""

from __future__ import annotations

from hand_model.effects.effect import Effect, Times
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def damping(q, omega):  # type: ignore[no-untyped-def]
    """Damping added by the quadratic part."""
    (quadratic,) = q
    return quadratic * abs(omega)


EFFECT = Effect(
    name="viscous_friction",
    place="joint",
    parameters=(
        Parameter("viscous_friction.quadratic_nm_s2_per_rad2", 0.0, 1.0, "torque per squared speed", 1.0, 0.0, 1e-3),
    ),
    hooks={"damping": damping},
    keys=("dynamics.viscous_friction_nm_s_per_rad", "viscous_friction.quadratic_nm_s2_per_rad2"),
    probes=((Times(1.5), 0.0), (Times(0.6), 0.0), (Times(3.0), 0.0), (Times(1.0), 1e-3)),
    says="viscous friction is {viscous_friction_nm_s_per_rad}, with {quadratic_nm_s2_per_rad2} more at speed",
    experiments=("steps", "multisine"),
    doc="Linear damping that differs from the nominal one, and drag.",
    source="Eq. 8, Martin et al. 2004; quadratic drag",
)
