"""Rows of a loop's working array: those of rows.py, then what the loops themselves keep."""

from __future__ import annotations

import numpy as np

from hand_model.arrays import Array
from hand_model.kernel.rows import ROW, STATE_ROW, STATES, WORK_ROWS
from hand_model.material import mean_rate
from hand_model.statics import equilibrium_angle

P, PHI, OMEGA, CREEP = range(STATES)
"""Rows of a state array: pressure [Pa], angle [rad], speed [rad/s], creeping ratio."""
X = STATE_ROW
"""First row of the state."""
ACCELERATION, PHI_BEFORE = range(WORK_ROWS, WORK_ROWS + 2)
"""Acceleration of the last step [rad/s^2]; angle before it [rad]."""
BEFORE, AFTER, ARRIVAL = range(WORK_ROWS + 2, WORK_ROWS + 5)
"""Set-points of a sample [Pa], and the step at which the second one reaches the valve."""
ACTUATOR, MEAN_CREEP, RISE = range(WORK_ROWS + 5, WORK_ROWS + 8)
"""Pressure at the actuator [Pa] and creeping ratio, mean over the step; rate of the pressure [Pa/s]."""
INPUT, INFLOW_OF_HAND, NEIGHBOUR_ANGLE = range(WORK_ROWS + 8, WORK_ROWS + 11)
"""Measured input pressure [Pa]; what a joint meets of others: inflow of the hand [Pa/s], a neighbour's angle [rad]."""
OVERRUN = WORK_ROWS + 11
"""Part of the sum of the speeds at both ends of a step that a joint does not go because friction stops it [rad/s]."""
FILLING, OF_HAND = range(WORK_ROWS + 12, WORK_ROWS + 14)
"""Rate of filling of a joint in a step or in its trial [Pa/s]; numbers of the whole hand, one a lane, see inflow.py."""
SPEED_AFTER, FREE_AFTER, STEP_MASS, RUB = range(WORK_ROWS + 14, WORK_ROWS + 18)
"""Of a pair with dry friction: speed after the step, and without friction [rad/s]; diagonal of the matrix of the step
[kg m^2]; largest impulse of friction [N m s]."""
PER_TAU, PER_STOP, PER_CONTACT, PER_12_INERTIA, EXTENSION, RECOVERY = range(WORK_ROWS + 18, WORK_ROWS + 24)
"""Prepared constants of the plain plant: reciprocals [1/s, 1/rad, 1/(kg m^2)] and rates of creep [1/s],
see `prepare_rows`."""
WORK = RECOVERY + 1
"""Number of rows."""

_RECIPROCALS = (
    (PER_TAU, ROW["valve.time_constant_s"]),
    (PER_STOP, ROW["end_stop.engagement_deg"]),
    (PER_CONTACT, ROW["contact.engagement_deg"]),
)
_DECAYS = (
    (EXTENSION, ROW["material.extension_time_s"]),
    (RECOVERY, ROW["material.recovery_time_s"]),
)


def resting_states(parameters: Array) -> Array:
    """States (STATES, ...) of vented joints that have rested for long: no pressure, no creep.

    parameters: (rows, ...), SI.
    """
    state = np.zeros((STATES, *parameters.shape[1:]))
    a0, a1, a2, a3 = parameters[ROW["statics.a0_nm"] : ROW["statics.a3_nm_per_pa_rad"] + 1]
    angle = equilibrium_angle.py_func(0.0, 0.0, parameters[ROW["constant_load.torque_nm"]], a0, a1, a2, a3, 0.0)
    state[PHI] = np.clip(angle, parameters[ROW["end_stop.low_deg"]], parameters[ROW["end_stop.high_deg"]])
    return state


def prepare_rows(w: Array, h: float) -> None:
    """Fill the prepared constants of a working array (..., WORK, lanes) in place, for steps of h [s].

    With the rates of creep (material.mean_rate), one step at constant pressure is exact.
    """
    for target, source in _RECIPROCALS:
        w[..., target, :] = 1.0 / w[..., source, :]
    w[..., PER_12_INERTIA, :] = 1.0 / (12.0 * w[..., ROW["dynamics.inertia_kg_m2"], :])
    for target, source in _DECAYS:
        w[..., target, :] = mean_rate(w[..., source, :], h)
