"""Whether the pressures do what the set-points ask: over-pressure, and valves that do not follow.

    what                                                         reaction
    above the limit by more than OVER, for OVER_S                vent, latched
    above what the valve's model expects, for NOT_FOLLOWING_S    vent, latched: the joint cannot be let go otherwise
    below it, for NOT_FOLLOWING_S                                warning, and the integrators stand still: a leak, an
                                                                 empty supply or a shut valve gives less than was asked
The expectation is the set-point through the valve's dead time and lag, from the pressure measured at first.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from hand_model.arrays import Array
from hand_model.description import Hand

OVER = 0.1
OVER_S = 0.05
NOT_FOLLOWING_S = 0.5
BAND_PA = 2.0e4
BAND = 0.1
"""A pressure within BAND_PA plus BAND of the expected follows."""
FINE, OVER_PRESSURE, STUCK_HIGH, STUCK_LOW = range(4)
_EXPECTED, _OVER, _HIGH, _LOW = range(4)


@njit(cache=True)
def _watch(s, lag, limit, command, pressure, dt):  # type: ignore[no-untyped-def]
    verdict, worst = FINE, 0
    for i in range(len(command)):
        s[_EXPECTED, i] += dt / (dt + lag[i]) * (command[i] - s[_EXPECTED, i])
        band = BAND_PA + BAND * s[_EXPECTED, i]
        excess = pressure[i] - s[_EXPECTED, i]
        s[_OVER, i] = s[_OVER, i] + dt if pressure[i] > (1.0 + OVER) * limit[i] else 0.0
        s[_HIGH, i] = s[_HIGH, i] + dt if excess > band else 0.0
        s[_LOW, i] = s[_LOW, i] + dt if excess < -band else 0.0
        found = FINE
        if s[_OVER, i] > OVER_S:
            found = OVER_PRESSURE
        elif s[_HIGH, i] > NOT_FOLLOWING_S:
            found = STUCK_HIGH
        elif s[_LOW, i] > NOT_FOLLOWING_S:
            found = STUCK_LOW
        if found != FINE and (verdict == FINE or found < verdict):
            verdict, worst = found, i
    return verdict, worst


class PressureWatch:
    """The memory of the watch on one hand."""

    def __init__(self, hand: Hand) -> None:
        """Begin with nothing expected; begin anew by `start`."""
        self._lag = hand.row("valve.time_constant_s") + hand.row("valve.dead_time_s")
        self._limit = np.asarray(hand.limits.max_pressure_pa, dtype=np.float64)
        self._state = np.zeros((4, len(hand.joints)))

    def start(self, pressure: Array) -> None:
        """Expect the measured pressure (n,) [Pa]."""
        self._state[:] = 0.0
        self._state[_EXPECTED] = pressure

    def look(self, command: Array, pressure: Array, dt: float) -> tuple[int, int]:
        """Verdict and its joint after dt [s] under command (n,) [Pa], now at pressure (n,) [Pa]."""
        return _watch(self._state, self._lag, self._limit, command, pressure, dt)  # type: ignore[no-any-return]
