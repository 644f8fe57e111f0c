"""From the moment the hand is enabled, pressure rises along a ramp from what is measured, never at once.

The ramp ends when every set-point is within its allowance, which is at once where the hand rests. Lower set-points
always pass.
"""

from __future__ import annotations

import numpy as np

from hand_model.arrays import Array

RAMP_PA_PER_S = 2e5
"""Rate of the allowance: 6 bar within 3 s."""


class ArmingRamp:
    """Limits the set-points of one hand after each arming."""

    def __init__(self) -> None:
        """Begin without a limit."""
        self._allowed_pa: Array | None = None

    @property
    def active(self) -> bool:
        """Whether set-points are limited; then nothing is to be integrated."""
        return self._allowed_pa is not None

    def start(self, pressure_pa: Array) -> None:
        """Begin at measured pressures (n,) [Pa]."""
        self._allowed_pa = np.fmax(pressure_pa, 0.0)

    def limit(self, command_pa: Array, dt: float) -> None:
        """Limit set-points (n,) [Pa] in place, dt [s] after the last call."""
        if self._allowed_pa is None:
            return
        self._allowed_pa += RAMP_PA_PER_S * dt
        if dt > 0.0 and (command_pa <= self._allowed_pa).all():  # a tick without time asks for nothing yet
            self._allowed_pa = None
        else:
            np.minimum(command_pa, self._allowed_pa, out=command_pa)
