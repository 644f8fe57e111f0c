"""After the hand was vented by its board, pressure returns along a ramp from what is measured, never at once.

While the board reports VENTED, and after a new connection, the allowance of each valve is its measured pressure. From
then on it rises by RAMP_PA_PER_S. The ramp ends when every set-point is within its allowance. Lower set-points always
pass. Times are nanoseconds of one monotonic clock and are arguments.
"""

from __future__ import annotations

import numpy as np

from hand_driver.board import Pressures

RAMP_PA_PER_S = 2e5
"""Rate at which pressure returns: 6 bar within 3 s."""


class PressureRamp:
    """Limits the set-points of one hand. `limit` may run in another thread than `frame`."""

    def __init__(self, valves: int) -> None:
        """Begin with a ramp from 0 Pa."""
        self._valves = valves
        self.begin()

    def begin(self) -> None:
        """Begin a ramp from what the next frame measures; nothing but 0 Pa passes before it."""
        self._vented, self._since_ns = True, -1
        self._base_pa = np.zeros(self._valves)
        self.active = True

    def frame(self, vented: bool, pressure_pa: Pressures, now_ns: int) -> None:
        """Take a frame: whether the board is vented, and the measured pressures (valves,) [Pa], NaN where unknown."""
        if vented or self._since_ns < 0:
            self._base_pa = np.fmax(pressure_pa, 0.0)
            self._since_ns = now_ns
            self.active = True
        self._vented = vented

    def limit(self, pressure_pa: Pressures, now_ns: int) -> Pressures:
        """Set-points (valves,) [Pa] that may be written now."""
        if not self.active:
            return pressure_pa
        if self._since_ns < 0:
            return np.zeros(self._valves)
        allowed = self._base_pa + RAMP_PA_PER_S * max(now_ns - self._since_ns, 0) * 1e-9
        if not self._vented and (pressure_pa <= allowed).all():
            self.active = False
            return pressure_pa
        return np.minimum(pressure_pa, allowed)
