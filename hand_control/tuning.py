"""The law's gains from the description of a hand and the controller's settings."""

from __future__ import annotations

import numpy as np

from hand_control.contact import threshold
from hand_control.law_rows import GAINS, G
from hand_control.settings import Settings
from hand_model.arrays import Array
from hand_model.description import Hand

_MODEL = {
    "a0": "statics.a0_nm",
    "a1": "statics.a1_nm_per_rad",
    "a2": "statics.a2_nm_per_pa",
    "a3": "statics.a3_nm_per_pa_rad",
    "phi_max": "material.phi_max_deg",
    "p_min": "material.p_min_pa",
    "b1": "material.b1_per_pa",
    "b0": "material.b0_per_pa",
    "inertia": "dynamics.inertia_kg_m2",
    "viscous": "dynamics.viscous_friction_nm_s_per_rad",
    "coupling": "dynamics.coupling_inertia_kg_m2",
    "valve_lag": "valve.time_constant_s",
    "dead_time": "valve.dead_time_s",
}


def gains(hand: Hand, settings: Settings) -> Array:
    """Gains (rows, n) of a hand, rows as in `law_rows`."""
    g = np.zeros((len(GAINS), len(hand.joints)))
    for name, key in _MODEL.items():
        g[G[name]] = hand.row(key)
    g[G["extension_rate"]] = 1.0 / hand.row("material.extension_time_s")
    g[G["recovery_rate"]] = 1.0 / hand.row("material.recovery_time_s")
    g[G["partner"]] = hand.partner
    g[G["p_max"]] = hand.limits.max_pressure_pa
    g[G["low"]], g[G["high"]] = hand.limits.low_rad, hand.limits.high_rad
    g[G["i_max"]] = settings.integral_limit
    for name in _TUNING:
        g[G[name]] = getattr(settings, name)
    g[G["threshold"]] = threshold(settings.false_alarms_per_hour, settings.observer_filter)
    return g


_TUNING = (
    "kp", "ki", "kd", "speed_filter", "observer_filter", "p_rate", "deadband", "tracking_time", "response_time",
    "memory", "adapt_bound", "map_uncertainty", "residual_std", "map_error", "back_calculation", "feed_forward",
    "creep", "schedule", "adapt", "detect", "torque_mode",
)  # fmt: skip
