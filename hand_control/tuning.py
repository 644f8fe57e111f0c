"""The gains of the law from the description of a hand and the settings of the controller."""

from __future__ import annotations

import numpy as np

from hand_control.contact import threshold
from hand_control.declared import DECLARED, GAINS, MODEL_ROWS, G, Settings
from hand_model.arrays import Array
from hand_model.description import Hand


def gains(hand: Hand, settings: Settings) -> Array:
    """Gains (rows, joints) of a hand in SI units; `declared.GAINS` names the rows."""
    g = np.zeros((len(GAINS), len(hand.joints)))
    for row, declared in enumerate(MODEL_ROWS):
        if declared.key:
            g[row] = hand.row(declared.key)
    g[G.extension_rate] = 1.0 / hand.row("material.extension_time_s")
    g[G.recovery_rate] = 1.0 / hand.row("material.recovery_time_s")
    first, second = hand.row("valve.time_constant_s"), hand.row("valve_lag.time_constant_s")
    third, dead = hand.row("tube_lag.time_constant_s"), hand.row("valve.dead_time_s")
    g[G.valve_lag] = first + second + third
    g[G.lead_2] = first * second + (first + second) * third + (first + second + third) * dead + 0.5 * dead * dead
    g[G.partner] = hand.partner
    limits = hand.limits
    g[G.p_max], g[G.low], g[G.high] = limits.max_pressure_pa, limits.low_rad, limits.high_rad
    for name, parameter in DECLARED.items():
        if parameter.row:
            g[getattr(G, parameter.row)] = settings.row(name)
    g[G.threshold] = threshold(settings.contact_false_alarms_per_hour, settings.observer_filter_s)
    return g
