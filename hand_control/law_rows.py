"""Rows of the control law's arrays; firmware/hand_law.h has the same names in the same order."""

from __future__ import annotations

GAINS = (
    "a0", "a1", "a2", "a3", "phi_max", "p_min", "b1", "extension_rate", "b0", "recovery_rate", "inertia", "viscous",
    "coupling", "partner", "valve_lag", "dead_time", "low", "high", "p_max",
    "kp", "ki", "kd", "i_max", "speed_filter", "observer_filter", "p_rate", "deadband", "tracking_time",
    "response_time", "memory", "adapt_bound", "map_uncertainty", "residual_std", "map_error", "threshold",
    "back_calculation", "feed_forward", "creep", "schedule", "adapt", "detect", "torque_mode",
)  # fmt: skip
"""Rows of the gains: the model of each joint [SI], the tuning, and a switch (0 or 1) for every part."""
STATE = (
    "integral", "command", "fresh", "creep", "last", "speed", "phi_1", "phi_2", "p_1", "p_2", "q_1", "q_2",
    "acceleration", "d_a0", "d_a1", "d_a3", "d_viscous",
    "c00", "c01", "c02", "c03", "c11", "c12", "c13", "c22", "c23", "c33",
    "bias", "sum", "age", "contact", "quiet", "started", "blind", "moving", "calm",
)  # fmt: skip
"""Rows of the state: integral [N m], command [Pa], filters, relative changes of the map, their covariance, detector."""
OUTPUT = ("pressure", "torque", "saturated", "contact", "contact_torque", "contact_age")
"""Rows of the output: command [Pa], actuator torque [N m], 1 where cut, 1 in contact, its torque [N m], age [s]."""

G = {name: row for row, name in enumerate(GAINS)}
S = {name: row for row, name in enumerate(STATE)}
PRESSURE, TORQUE, SATURATED, CONTACT, CONTACT_TORQUE, CONTACT_AGE = range(len(OUTPUT))
