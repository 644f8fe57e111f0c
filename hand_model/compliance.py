"""Compliance at constant fluid mass, Eq. 7: what pressure and torque do while something opens the finger.

Pneumatic: p_abs V_a^n is constant, n = 1 isothermal (Boyle-Mariotte), up to 1.4 adiabatic. Hydraulic: V_a is constant.
The volume map belongs to the torque map by virtual work: dV_a/dphi = dM_a/dp = a2 + a3 phi.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from hand_model.arrays import Array
from hand_model.statics import chamber_volume, torque

ATMOSPHERE_PA = 101325.0
HIGHEST_PA = 5e7
"""Far beyond any pressure of interest; a bracket for the search of the gas law's root."""


@dataclass(frozen=True, slots=True)
class Actuator:
    """Coefficients of Eq. 6 (a0 ... a3) and of the volume V_a = v0 + c_v p + a2 phi + a3 phi^2 / 2; SI, gauge."""

    a0: float
    a1: float
    a2: float
    a3: float
    v0: float = 2e-6
    c_v: float = 1.2e-12

    def volume_m3(self, pressure_pa: Array | float, phi: Array | float) -> Array:
        """V_a [m^3] at gauge pressures (n,) and angles (n,), or single ones; the map measured with Eq. 6."""
        return np.asarray(chamber_volume(pressure_pa, phi, self.v0, self.c_v, self.a2, self.a3))

    def torque_nm(self, pressure_pa: Array, phi: Array) -> Array:
        """M_a (n,) [N m] at gauge pressures (n,) and angles (n,), Eq. 6."""
        return np.asarray(torque(pressure_pa, phi, 0.0, self.a0, self.a1, self.a2, self.a3, 0.0))


def pneumatic_pressure_pa(actuator: Actuator, start_pa: float, start_rad: float, phi: Array, exponent: float) -> Array:
    """Gauge pressure (n,) at angles phi (n,) [rad] for a closed valve, Eq. 7 with a polytropic exponent.

    Raises ValueError for an exponent outside 1 ... 1.67.
    """
    if not 1.0 <= exponent <= 1.67:
        raise ValueError(f"the polytropic exponent is {exponent:g}; the allowed range is 1 to 1.67")
    held = (start_pa + ATMOSPHERE_PA) * float(actuator.volume_m3(start_pa, start_rad)) ** exponent

    def at(angle: float) -> float:
        def excess(pressure: float) -> float:
            return float((pressure + ATMOSPHERE_PA) * float(actuator.volume_m3(pressure, angle)) ** exponent - held)

        return float(brentq(excess, -0.99 * ATMOSPHERE_PA, HIGHEST_PA, xtol=1e-3))

    return np.array([at(float(angle)) for angle in phi])


def hydraulic_pressure_pa(actuator: Actuator, start_pa: float, start_rad: float, phi: Array) -> Array:
    """Gauge pressure (n,) at angles phi (n,) [rad] for a closed valve, constant volume, Eq. 7."""
    volume = actuator.volume_m3(start_pa, start_rad)
    return np.asarray((volume - actuator.volume_m3(0.0, phi)) / actuator.c_v)


def stiffness_nm_per_rad(phi: Array, torque_nm: Array) -> Array:
    """dM/dphi (n,) [N m/rad] along a trajectory of Eq. 7, total: geometry and fluid together."""
    return np.asarray(np.gradient(torque_nm, phi))
