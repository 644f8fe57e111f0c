"""Cubic curves through positions with given slopes, and monotone slopes where none are given.

scipy.interpolate has both. Its import alone is a large part of the start of a controller; the tests compare with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hand_model.arrays import Array


@dataclass(frozen=True, slots=True)
class HermiteCurve:
    """Piecewise cubics through positions (m, k) [rad] with slopes (m, k) [rad/s] at rising times (m,) [s], m > 1."""

    times_s: Array
    position_rad: Array
    slope_rad_s: Array

    def at(self, time_s: float) -> tuple[Array, Array]:
        """Positions (k,) [rad] and speeds (k,) [rad/s] at a time [s]; beyond its ends by the first or last cubic."""
        n = min(max(int(np.searchsorted(self.times_s, time_s, side="right")) - 1, 0), len(self.times_s) - 2)
        span, since = float(self.times_s[n + 1] - self.times_s[n]), time_s - float(self.times_s[n])
        first, last = self.slope_rad_s[n], self.slope_rad_s[n + 1]
        mean = (self.position_rad[n + 1] - self.position_rad[n]) / span
        bend = (first + last - 2.0 * mean) / span
        square, cube = (mean - first) / span - bend, bend / span
        position = self.position_rad[n] + since * (first + since * (square + since * cube))
        return position, first + since * (2.0 * square + 3.0 * since * cube)


def monotone_slopes(times_s: Array, position_rad: Array) -> Array:
    """Slopes (m, k) [rad/s] with which a curve through positions (m, k) [rad] overshoots none; 0 at both ends.

    times_s: (m,) rising [s]. Weighted harmonic means (Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5(2), 1984).
    """
    slopes = np.zeros_like(position_rad)
    span = np.diff(times_s)[:, None]
    with np.errstate(all="ignore"):  # steps near the smallest number overflow on the way to a slope of 0
        mean = np.diff(position_rad, axis=0) / span
        before, after = 2.0 * span[1:] + span[:-1], span[1:] + 2.0 * span[:-1]
        inside = (before + after) / (before / mean[:-1] + after / mean[1:])
        inside[np.sign(mean[:-1]) * np.sign(mean[1:]) <= 0.0] = 0.0
    slopes[1:-1] = np.nan_to_num(inside, posinf=0.0, neginf=0.0)
    return slopes
