"""The static map bends beyond the bilinear one of Eq. 6."""

from __future__ import annotations

from hand_model.effects.effect import Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def torque(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """Next terms of the series of the static map."""
    quadratic, cubic, mixed, square_p = q
    square = phi * phi
    added = (mixed * square + square_p * p) * p - (quadratic + cubic * phi) * square
    return added, (2.0 * quadratic + 3.0 * cubic * phi - 2.0 * mixed * p) * phi


EFFECT = Effect(
    name="stiffening",
    place="material",
    parameters=(
        Parameter("stiffening.quadratic_nm_per_rad2", -1.0, 1.0, "elastic torque per squared angle", 1.0, 0.0, 0.01),
        Parameter("stiffening.cubic_nm_per_rad3", -1.0, 1.0, "elastic torque per cubed angle", 1.0, 0.0, 0.01),
        Parameter(
            "stiffening.mixed_nm_per_pa_rad2", -1e-5, 1e-5, "torque per pressure and squared angle", 1.0, 0.0, 1e-7
        ),
        Parameter("stiffening.square_nm_per_pa2", -1e-10, 1e-10, "torque per squared pressure", 1.0, 0.0, 2e-13),
    ),
    hooks={"torque": torque},
    keys=(
        "stiffening.quadratic_nm_per_rad2",
        "stiffening.cubic_nm_per_rad3",
        "stiffening.mixed_nm_per_pa_rad2",
        "stiffening.square_nm_per_pa2",
    ),
    probes=(
        (0.0, 0.01, 0.0, 0.0),
        (0.0, -0.01, 0.0, 0.0),
        (0.0, 0.0, -5e-8, 0.0),
        (0.0, 0.0, 5e-8, 0.0),
        (0.0, 0.0, 0.0, -3e-13),
        (0.0, 0.0, 0.0, 3e-13),
    ),
    says="the static curve has higher-order terms: {quadratic_nm_per_rad2}, {cubic_nm_per_rad3},"
    " {mixed_nm_per_pa_rad2}, {square_nm_per_pa2}",
    experiments=("staircase", "slow_triangle"),
    doc="Higher terms of the torque map in angle and pressure.",
    source="series beyond Eq. 6, Martin et al. 2004",
)
