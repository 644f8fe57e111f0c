"""The static map bends beyond the bilinear one of Eq. 6."""

from __future__ import annotations

from hand_model.effects.effect import Effect, declare, inline
from hand_model.plant_parameters import Parameter

QUADRATIC, CUBIC, MIXED, SQUARE = declare(
    Parameter("stiffening.quadratic_nm_per_rad2", -1.0, 1.0, "elastic torque per squared angle", 1.0, 0.0, 0.01),
    Parameter("stiffening.cubic_nm_per_rad3", -1.0, 1.0, "elastic torque per cubed angle", 1.0, 0.0, 0.01),
    Parameter("stiffening.mixed_nm_per_pa_rad2", -1e-5, 1e-5, "torque per pressure and squared angle", 1.0, 0.0, 1e-7),
    Parameter("stiffening.square_nm_per_pa2", -1e-10, 1e-10, "torque per squared pressure", 1.0, 0.0, 2e-13),
)


@inline
def torque(w, i, phi, omega, p, e):  # type: ignore[no-untyped-def]
    """Next terms of the static map's series."""
    square = phi * phi
    added = (w[MIXED, i] * square + w[SQUARE, i] * p) * p - (w[QUADRATIC, i] + w[CUBIC, i] * phi) * square
    return added, (2.0 * w[QUADRATIC, i] + 3.0 * w[CUBIC, i] * phi - 2.0 * w[MIXED, i] * p) * phi


EFFECT = Effect(
    "stiffening",
    "material",
    (
        "stiffening.quadratic_nm_per_rad2",
        "stiffening.cubic_nm_per_rad3",
        "stiffening.mixed_nm_per_pa_rad2",
        "stiffening.square_nm_per_pa2",
    ),
    (
        (0.0, 0.01, 0.0, 0.0),
        (0.0, -0.01, 0.0, 0.0),
        (0.0, 0.0, -5e-8, 0.0),
        (0.0, 0.0, 5e-8, 0.0),
        (0.0, 0.0, 0.0, -3e-13),
        (0.0, 0.0, 0.0, 3e-13),
    ),
    "the static curve has higher-order terms: {quadratic_nm_per_rad2}, {cubic_nm_per_rad3},"
    " {mixed_nm_per_pa_rad2}, {square_nm_per_pa2}",
    ("staircase", "slow_triangle"),
    "Higher terms of the torque map in angle and pressure.",
    "series beyond Eq. 6, Martin et al. 2004",
    {"torque": torque},
)
