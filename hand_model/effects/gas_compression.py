"""Motion changes the volume of the actuator and so the pressure, Eq. 7."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import ANGLE, ATMOSPHERE_PA, SPEED, Effect
from hand_model.kernel.inline import inline, inlined
from hand_model.kernel.plant_rows import Parameter
from hand_model.statics import chamber_volume, leverage

_volume, _leverage = inlined(chamber_volume), inlined(leverage)
SMALLEST_M3 = 1e-7
"""No chamber is taken as smaller, whatever the parameters."""


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Reciprocal of the supply pressure, and the share of the way to the wall's temperature within a step."""
    return 1.0 / q[9], h / (q[6] + 0.5 * h)


@inline
def set_point(q, m, u, p, e, h):  # type: ignore[no-untyped-def]
    """The speed as the heat of the gas follows it, a first-order lag by the midpoint rule; the set-point as it is."""
    return u, (m[0] + (e[SPEED] - m[0]) * q[11],)


@inline
def pressure_source(q, m, p, e):  # type: ignore[no-untyped-def]
    """p_abs V^n is constant but for what the valve feeds; dV/dphi = a2 + a3 phi by virtual work.

    V also grows with the pressure, by c_V: p_abs' = -n p_abs (a2 + a3 phi) phi' / (V + n c_V p_abs).
    The law multiplies it by gains that change linearly with the pressure and with the angle and are never negative.
    And it lets the wall take a share of what compression heats, so that a slow motion has a smaller exponent.
    """
    exponent, vented, growth, gain, per_rad, taken, _, a2, a3, _, per_supply, _ = q
    stiff = exponent * (p + ATMOSPHERE_PA)
    volume = max(_volume(p, e[ANGLE], vented, growth, a2, a3), SMALLEST_M3)
    speed = e[SPEED] - taken * m[0]
    rate = -stiff * _leverage(e[ANGLE], a2, a3) * speed / (volume + stiff * growth)
    over_angle = min(max(1.0 + per_rad * e[ANGLE], 0.0), 10.0)
    return rate * (1.0 + gain * min(max(p * per_supply, 0.0), 1.0)) * over_angle


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Rise of the pressure x [Pa] per angle of a fast extension [Pa/rad], at the angle 0."""
    return float(pressure_source(q, (0.0,), x, (0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0)))


EFFECT = Effect(
    name="gas_compression",
    place="fluid",
    needs=("chamber",),
    parameters=(
        Parameter("gas_compression.exponent", 0.0, 3.0, "Eq. 7, polytropic exponent; 1 isothermal", 1.0, 0.0, 1.0),
        Parameter("gas_compression.volume_m3", 1e-7, 1e-3, "of actuator and tube, vented at 0", 1.0, 2e-6),
        Parameter("gas_compression.volume_m3_per_pa", 0.0, 1e-9, "growth of the volume with pressure", 1.0, 1.2e-12),
        Parameter(
            "gas_compression.with_pressure", -1.0, 10.0, "law: growth up to supply pressure", 1.0, 0.0, 0.5, law=True
        ),
        Parameter("gas_compression.gain_per_rad", -5.0, 20.0, "law: growth with the angle", 1.0, 0.0, 0.3, law=True),
        Parameter(
            "gas_compression.heat_share", 0.0, 1.0, "law: share that a slow motion lacks", 1.0, 0.0, 0.2, law=True
        ),
        Parameter("gas_compression.heat_time_s", 0.02, 10.0, "law: of the exchange of heat", 1.0, 0.5, 0.3, law=True),
    ),
    reads=("statics.a2_nm_per_pa", "statics.a3_nm_per_pa_rad", "supply.pressure_pa"),
    prepared=("per_supply", "approach"),
    memory=("exchanged",),
    law_memory=("exchanged",),
    hooks={"prepare": prepare, "set_point": set_point, "pressure_source": pressure_source},
    law_hooks=("set_point",),
    keys=("gas_compression.exponent",),
    probes=((1.0,), (0.3,)),
    spread={"gas_compression.volume_m3": 1.0, "gas_compression.volume_m3_per_pa": 1.0},
    says="motion compresses the gas (exponent {exponent}): the pressure rises when the joint is pushed open",
    experiments=("closed_valve_push", "steps"),
    doc="A change of angle changes the chamber volume; the valve needs time to restore the pressure.",
    source="Eq. 7, Martin et al. 2004, with absolute pressure and the volume map tied to Eq. 6 by virtual work",
    constitution=Constitution(
        acts_on="rate of the pressure",
        sign="opposes the change of volume",
        passive=True,
        monotone="in proportion to the speed, with at most as much for a slow motion as for a fast one; the gain is not"
        " negative at any pressure and angle",
        memory="the pressure, and the heat of the gas",
        over=("pressure", "angle", "speed"),
        coefficients=(
            "gas_compression.volume_m3",
            "gas_compression.volume_m3_per_pa",
            "gas_compression.with_pressure",
            "gas_compression.gain_per_rad",
            "gas_compression.heat_share",
            "gas_compression.heat_time_s",
        ),
        quantity="the rise of the {pressure} per {angle} against the {flexion}",
        unit="pa_per_rad",
        curve=curve,
        source="second law for a gas spring: its stiffness is positive; Beater, Pneumatic Drives, 2007, ch. 2;"
        " thermal time constant: Otis and Pourmovahed, J. Dyn. Sys. Meas. Control 107, 1985",
    ),
)
