"""From the moment the hand is enabled, pressure rises along a ramp from what is measured, never at once.

It begins again while the board reports that it is vented: the driver then limits the set-points likewise, and an
integrator that does not know it winds up. The ramp ends when every set-point has been within its allowance for END_S,
so that the ramp of the driver has ended before. Lower set-points always pass.
"""

from __future__ import annotations

import numpy as np

from hand_model.arrays import Array

RAMP_PA_PER_S = 2e5
"""Rate of the allowance: 6 bar within 3 s."""
END_S = 0.05
"""Several periods of the slowest board."""


class ArmingRamp:
    """Limits the set-points of one hand after each arming."""

    def __init__(self) -> None:
        """Begin without a limit."""
        self._allowed_pa: Array | None = None
        self._within_s = 0.0

    @property
    def active(self) -> bool:
        """Whether set-points are limited; then nothing is to be integrated."""
        return self._allowed_pa is not None

    def start(self, pressure_pa: Array) -> None:
        """Begin at measured pressures (n,) [Pa]."""
        self._allowed_pa = np.fmax(pressure_pa, 0.0)
        self._within_s = 0.0

    def limit(self, command_pa: Array, dt: float) -> None:
        """Limit set-points (n,) [Pa] in place, dt [s] after the last call."""
        if self._allowed_pa is None:
            return
        self._allowed_pa += RAMP_PA_PER_S * dt
        within = (command_pa <= self._allowed_pa).all()
        self._within_s = self._within_s + dt if within else 0.0
        if self._within_s >= END_S:
            self._allowed_pa = None
        elif not within:
            np.minimum(command_pa, self._allowed_pa, out=command_pa)
