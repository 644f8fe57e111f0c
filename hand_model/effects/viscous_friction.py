"""Damping of another size than modelled, or growing with the square of the speed."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect, Times
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def damping(q, omega):  # type: ignore[no-untyped-def]
    """Damping added by the quadratic part.

    By the law the torque also rises more steeply beyond 1, 3 and 10 rad/s, and a part of it thins with the rate.
    """
    quadratic, a, b, c, thinning, _ = q
    speed = abs(omega)
    steeper = a * max(speed - 1.0, 0.0) + b * max(speed - 3.0, 0.0) + c * max(speed - 10.0, 0.0)
    return quadratic * speed + steeper / max(speed, 1.0) + thinning / (1.0 + speed)


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Torque of the whole viscous friction [N m] at the speed x [rad/s]."""
    return float((q[5] + damping(q, x)) * x)


_STEEPER = tuple(
    Parameter(
        f"viscous_friction.beyond_{s}_nm_s_per_rad", 0.0, 10.0, f"law: more beyond {s} rad/s", 1.0, 0.0, 1e-3, law=True
    )
    for s in (1, 3, 10)
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
EFFECT = Effect(
    name="viscous_friction",
    place="joint",
    parameters=(
        Parameter("viscous_friction.quadratic_nm_s2_per_rad2", 0.0, 1.0, "torque per squared speed", 1.0, 0.0, 1e-3),
        *_STEEPER,
        _THINNING,
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
        monotone="the torque rises with the speed: convex, but for a part that thins with the rate",
        over=("speed",),
        coefficients=tuple(parameter.key for parameter in (*_STEEPER, _THINNING)),
        quantity="the viscous {torque}",
        unit="nm",
        curve=curve,
        source="Rayleigh's dissipation function; shear thinning by Cross, J. Colloid Sci. 20(5), 1965",
    ),
)
