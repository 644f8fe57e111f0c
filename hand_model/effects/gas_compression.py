"""Motion changes the actuator volume and so the pressure, Eq. 7."""

from __future__ import annotations

from hand_model.effects.effect import ANGLE, ATMOSPHERE_PA, SPEED, Effect, declare, inline
from hand_model.plant_parameters import PLANT_ROW, Parameter
from hand_model.statics import chamber_volume

EXPONENT, VOLUME, GROWTH = declare(
    Parameter("gas_compression.exponent", 0.0, 3.0, "Eq. 7, polytropic exponent; 1 isothermal", 1.0, 0.0, 1.0),
    Parameter("gas_compression.volume_m3", 1e-7, 1e-3, "of actuator and tube, vented at 0", 1.0, 2e-6),
    Parameter("gas_compression.volume_m3_per_pa", 0.0, 1e-9, "growth of the volume with pressure", 1.0, 1.2e-12),
)
_volume = inline(chamber_volume.py_func)
_A2, _A3 = PLANT_ROW["statics.a2_nm_per_pa"], PLANT_ROW["statics.a3_nm_per_pa_rad"]


@inline
def pressure_rate(w, i, rate, p, u, e):  # type: ignore[no-untyped-def]
    """p_abs V^n is constant but for what the valve feeds; dV/dphi = a2 + a3 phi by virtual work."""
    phi = e[ANGLE]
    displaced = w[_A2, i] + w[_A3, i] * phi
    volume = _volume(p, phi, w[VOLUME, i], w[GROWTH, i], w[_A2, i], w[_A3, i])
    return rate - w[EXPONENT, i] * (p + ATMOSPHERE_PA) * displaced * e[SPEED] / max(volume, 1e-7)


EFFECT = Effect(
    "gas_compression",
    "fluid",
    ("gas_compression.exponent",),
    ((1.0,), (0.3,)),
    "motion compresses the gas (exponent {exponent}): the pressure rises when the joint is pushed open",
    ("closed_valve_push", "steps"),
    "A change of angle changes the chamber volume; the valve needs time to restore the pressure.",
    "Eq. 7, Martin et al. 2004, with absolute pressure and the volume map tied to Eq. 6 by virtual work",
    {"pressure_rate": pressure_rate},
)
