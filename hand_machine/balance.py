"""The balance of forces of the nominal model over a recorded motion, and what in it shows wrong signs or units."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.signal import savgol_filter

from hand_machine.description import MachineDescription
from hand_machine.reading import Readings
from hand_model.arrays import Array
from hand_recording.recording_files import RecordingError

SMOOTHED_S = 0.05
"""Half the window over which positions are differentiated, to see what force the nominal model lacks."""
ALIKE = 0.8
"""Correlation of two forces from which their ratio means something: what one leaves of the other is below 60 %."""
MAX_RATIO = 20.0
"""Largest plausible ratio of two such forces, or its inverse; wrong units are off by 57 (degrees) or more."""


def balance(described: MachineDescription, table: Readings) -> tuple[Array, Array] | None:
    """Force of the input and passive force of the nominal model (T,) each [N or N m]; None for a short recording."""
    period = table.period_s
    window = min(2 * round(SMOOTHED_S / period) + 1, (len(table.time_s) - 1) // 2 * 2 + 1)
    if window < 5:
        return None
    x, v, a = (savgol_filter(table.signals["position"], window, 3, deriv=k, delta=period) for k in range(3))
    passive = described.stiffness * x + described.damping * v + described.inertia * a + described.weight * np.sin(x)
    return described.gain * table.signals["input"], passive


def check_plausible(described: MachineDescription, path: Path, table: Readings) -> None:
    """Refuse a recording whose force is that of the nominal model with the other sign or in another unit.

    Only where the two are alike: what the model lacks may be as large as what it has. Raises RecordingError, one line.
    """
    _check_period(described, path, table)
    forces = balance(described, table)
    if forces is None or table.known.sum() < 5:
        return
    driving, passive = (force[table.known] for force in forces)
    measured, expected = (
        (table.signals["force"][table.known], driving - passive)
        if described.imposed
        else (
            driving,
            passive,
        )
    )
    if np.std(measured) == 0.0 or np.std(expected) == 0.0:
        return
    alike = float(np.corrcoef(measured, expected)[0, 1])
    pair = ("force", "the motion and input") if described.imposed else ("input", "the motion")
    if alike < -ALIKE:
        raise RecordingError(
            f"{path}: the {pair[0]} has the opposite sign of what the model expects from {pair[1]} (correlation"
            f" {alike:.2f}); change the sign of columns.{pair[0]}.scale or columns.position.scale"
        )
    ratio = float(np.std(measured) / np.std(expected))
    if alike > ALIKE and not 1.0 / MAX_RATIO < ratio < MAX_RATIO:
        raise RecordingError(
            f"{path}: the {pair[0]} is {ratio:.2g} times what the model expects from {pair[1]}; check the units of the"
            f" columns {pair[0]} and position (key scale) and the numbers of the model"
        )


def _check_period(described: MachineDescription, path: Path, table: Readings) -> None:
    """Refuse samples too far apart for the nominal model's own oscillation (Shannon, 1949)."""
    if described.stiffness == 0.0 or described.inertia == 0.0:
        return
    natural = float(np.sqrt(described.stiffness / described.inertia))
    damping_ratio = described.damping / (2.0 * np.sqrt(described.stiffness * described.inertia))
    if damping_ratio < 1.0 and natural * table.period_s > np.pi:
        raise RecordingError(
            f"{path}: samples are {table.period_s:.3g} s apart, and the model oscillates at {natural / 2.0 / np.pi:.3g}"
            " Hz; check columns.time.scale, stiffness and inertia"
        )
