"""Damping of another size than modelled, growing with the square of the speed, or larger in one direction."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect, Times
from hand_model.effects.operators import direction
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def damping(q, omega):  # type: ignore[no-untyped-def]
    """Damping added by the quadratic part.

    By the law, shares of it appear with the speed, half of each at 0.3, 1, 3 and 10 rad/s, and one thins with it; the
    whole, nominal damping included, is larger in one direction of motion than in the other.
    """
    quadratic, a, b, c, d, thinning, asymmetry, nominal = q
    speed = abs(omega)
    appears = a / (speed + 0.3) + b / (speed + 1.0) + c / (speed + 3.0) + d / (speed + 10.0)
    added = quadratic * speed + appears * speed + thinning / (1.0 + speed)
    return added + asymmetry * direction(omega) * (nominal + added)


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Torque of the whole viscous friction [N m] at the speed x [rad/s]."""
    return float((q[7] + damping(q, x)) * x)


_APPEARS = tuple(
    Parameter(
        f"viscous_friction.from_{name}_nm_s_per_rad",
        0.0,
        10.0,
        f"law: more at speed, half of it at {speed} rad/s",
        1.0,
        0.0,
        1e-3,
        law=True,
    )
    for name, speed in (("0_3", 0.3), ("1", 1), ("3", 3), ("10", 10))
)
_THINNING = Parameter(
    "viscous_friction.thinning_nm_s_per_rad",
    0.0,
    10.0,
    "law: more at rest, half of it at 1 rad/s",
    1.0,
    0.0,
    2e-3,
    law=True,
)
_ASYMMETRY = Parameter(
    "viscous_friction.asymmetry",
    -0.9,
    0.9,
    "law: share more when flexing, less when extending",
    1.0,
    0.0,
    0.3,
    law=True,
)
EFFECT = Effect(
    name="viscous_friction",
    place="joint",
    parameters=(
        Parameter("viscous_friction.quadratic_nm_s2_per_rad2", 0.0, 1.0, "torque per squared speed", 1.0, 0.0, 1e-3),
        *_APPEARS,
        _THINNING,
        _ASYMMETRY,
    ),
    reads=("dynamics.viscous_friction_nm_s_per_rad",),
    hooks={"damping": damping},
    keys=("dynamics.viscous_friction_nm_s_per_rad", "viscous_friction.quadratic_nm_s2_per_rad2"),
    probes=((Times(1.5), 0.0), (Times(0.6), 0.0), (Times(3.0), 0.0), (Times(1.0), 1e-3)),
    absent={"dynamics.viscous_friction_nm_s_per_rad": 0.01},
    says="viscous friction is {viscous_friction_nm_s_per_rad}, with {quadratic_nm_s2_per_rad2} more at speed",
    experiments=("steps", "multisine"),
    doc="Linear damping that differs from the nominal one, and drag.",
    source="Eq. 8, Martin et al. 2004; quadratic drag",
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="against the motion",
        passive=True,
        monotone="the torque rises with the speed: convex, but for a part that thins with the rate; not less than"
        " a twentieth in one direction of what it is in the other",
        over=("speed",),
        coefficients=tuple(parameter.key for parameter in (*_APPEARS, _THINNING, _ASYMMETRY)),
        needs={_ASYMMETRY.key: "soft_material"},
        quantity="the viscous {torque}",
        unit="nm",
        curve=curve,
        source="Rayleigh's dissipation function; non-negative spectrum of rates: Schilling, Bernstein Functions, 2012;"
        " shear thinning: Cross, J. Colloid Sci. 20(5), 1965",
    ),
)
