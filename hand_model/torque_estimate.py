"""Torque from measured pressure and angle, Eq. 6, with its uncertainty (Martin et al. 2004, Sec. 2.3 and 3.1)."""

from __future__ import annotations

import numpy as np

from hand_model.arrays import Array


def torque_uncertainty_nm(
    pressure_pa: Array, phi: Array, values: Array, covariance: Array, pressure_std_pa: float, angle_std_rad: float
) -> tuple[Array, Array]:
    """Eq. 6 and its standard deviation [N m], (n,) each, by first-order propagation.

    values, covariance: a0 ... a3 (4,) and (4, 4) of the static identification; the stds are those of the sensors.
    """
    table = np.array([np.ones_like(phi), phi, pressure_pa, pressure_pa * phi]).T
    torque: Array = table @ values
    from_map = np.einsum("ni,ij,nj->n", table, covariance, table)
    by_pressure = (values[2] + values[3] * phi) * pressure_std_pa
    by_angle = (values[1] + values[3] * pressure_pa) * angle_std_rad
    return torque, np.sqrt(from_map + by_pressure**2 + by_angle**2)
