"""The static map bends beyond the bilinear one of Eq. 6."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Reciprocals of the range between the stops and of the supply pressure."""
    low, high, supply = q[16:19]
    return 1.0 / (high - low), 1.0 / supply


@inline
def _bump(weight, y, bumps, slope):  # type: ignore[no-untyped-def]
    """A bump added to their sum, and to the sum of their slopes over -4."""
    z = max(1.0 - y * y, 0.0)
    return bumps + weight * (z * z), slope + weight * (y * z)


@inline
def torque(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """Next terms of the series of the static map.

    The law adds bumps over the angle between the stops, (1 - y^2)^2 with y within -1 and 1, bumps over the pressure,
    and torques in proportion to the pressure that grow towards either stop.
    """
    quadratic, cubic, mixed, square_p = q[:4]
    square = phi * phi
    bent = quadratic + cubic * phi
    added = (mixed * square + square_p * p) * p - bent * square
    stiffness = (2.0 * (bent - mixed * p) + cubic * phi) * phi
    x, share = 3.5 * ((phi - q[16]) * q[19]), p * q[20]
    bumps, slope = _bump(q[4], x, 0.0, 0.0)
    bumps, slope = _bump(q[5], x - 0.5, bumps, slope)
    bumps, slope = _bump(q[6], x - 1.0, bumps, slope)
    bumps, slope = _bump(q[7], x - 1.5, bumps, slope)
    bumps, slope = _bump(q[8], x - 2.0, bumps, slope)
    bumps, slope = _bump(q[9], x - 2.5, bumps, slope)
    bumps, slope = _bump(q[10], x - 3.0, bumps, slope)
    bumps, slope = _bump(q[11], x - 3.5, bumps, slope)
    y, z = 3.0 * share - 1.0, 3.0 * share - 2.0
    y, z = max(1.0 - y * y, 0.0), max(1.0 - z * z, 0.0)
    high, low = max(x - 1.75, 0.0), max(1.75 - x, 0.0)
    pushed = q[14] * (high * high) + q[15] * (low * low)
    steeper = (14.0 * slope - 7.0 * share * (q[14] * high - q[15] * low)) * q[19]
    return added + (bumps + (q[12] * (y * y) + q[13] * (z * z)) + share * pushed), stiffness + steeper


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Torque beyond Eq. 6 [N m] at the angle x [rad] and the pressure y [Pa]."""
    return float(torque(q, x, 0.0, y, 0.0, ())[0])


_BUMPS = tuple(
    Parameter(f"stiffening.angle_{k}_nm", -5.0, 5.0, f"law: more at {k}/7 of the range", 1.0, 0.0, 0.005, law=True)
    for k in range(8)
)
_PRESSED = (
    Parameter(
        "stiffening.pressure_1_nm", -5.0, 5.0, "law: more at a third of supply pressure", 1.0, 0.0, 0.005, law=True
    ),
    Parameter("stiffening.pressure_2_nm", -5.0, 5.0, "law: more at two thirds of it", 1.0, 0.0, 0.005, law=True),
    Parameter(
        "stiffening.flexed_nm", -50.0, 50.0, "law: more with pressure, towards flexion", 1.0, 0.0, 0.01, law=True
    ),
    Parameter("stiffening.extended_nm", -50.0, 50.0, "law: the same towards extension", 1.0, 0.0, 0.01, law=True),
)
EFFECT = Effect(
    name="stiffening",
    place="material",
    needs=("elastic_part",),
    parameters=(
        Parameter("stiffening.quadratic_nm_per_rad2", -1.0, 1.0, "elastic torque per squared angle", 1.0, 0.0, 0.01),
        Parameter("stiffening.cubic_nm_per_rad3", -1.0, 1.0, "elastic torque per cubed angle", 1.0, 0.0, 0.01),
        Parameter(
            "stiffening.mixed_nm_per_pa_rad2", -1e-5, 1e-5, "torque per pressure and squared angle", 1.0, 0.0, 1e-7
        ),
        Parameter("stiffening.square_nm_per_pa2", -1e-10, 1e-10, "torque per squared pressure", 1.0, 0.0, 2e-13),
        *_BUMPS,
        *_PRESSED,
    ),
    reads=("end_stop.low_deg", "end_stop.high_deg", "supply.pressure_pa"),
    prepared=("per_range", "per_supply"),
    hooks={"prepare": prepare, "torque": torque},
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
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="either; it has a potential at constant pressure",
        passive=True,
        monotone="smooth in angle and pressure",
        over=("angle", "pressure"),
        coefficients=tuple(parameter.key for parameter in _BUMPS + _PRESSED),
        quantity="the {torque} beyond Eq. 6",
        unit="nm",
        curve=curve,
        source="hyperelasticity: the torque at constant pressure is a function of the angle alone; Ogden, Non-Linear"
        " Elastic Deformations, 1984",
    ),
)
