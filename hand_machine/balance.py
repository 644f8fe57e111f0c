"""The balance of forces of the nominal model over a recorded motion."""

from __future__ import annotations

import numpy as np
from scipy.signal import savgol_filter

from hand_machine.description import MachineDescription
from hand_machine.reading import Readings
from hand_machine.settings import MACHINE
from hand_model.arrays import Array

MIN_WINDOW = 5
"""Samples; a cubic through four follows their noise."""


def balance(described: MachineDescription, table: Readings) -> tuple[Array, Array] | None:
    """Force of the input and passive force of the nominal model (T,) each [N or N m]; None for a short recording."""
    moved = motion(table)
    if moved is None:
        return None
    x, v, a = moved
    passive = described.stiffness * x + described.damping * v + described.inertia * a + described.weight * np.sin(x)
    return described.gain * table.signals["input"], passive


def motion(table: Readings) -> tuple[Array, Array, Array] | None:
    """Position, speed and acceleration (T,) each, SI; None for a short recording."""
    window = _window(table)
    if window < MIN_WINDOW:
        return None
    x, v, a = (savgol_filter(table.signals["position"], window, 3, deriv=k, delta=table.period_s) for k in range(3))
    return x, v, a


def smoothed(table: Readings, values: Array) -> Array:
    """A signal (T,) [any unit] of a recording, smoothed as its motion is."""
    window = _window(table)
    return values if window < MIN_WINDOW else np.asarray(savgol_filter(values, window, 3))


def _window(table: Readings) -> int:
    """Odd number of samples; of slow readings the fewest that a cubic does not simply follow, unless they last long."""
    wanted = 2 * round(MACHINE.balance_half_window_s / table.period_s) + 1
    if (MIN_WINDOW - 1) * table.period_s <= MACHINE.longest_window_s:
        wanted = max(wanted, MIN_WINDOW)
    return min(wanted, (len(table.time_s) - 1) // 2 * 2 + 1)
