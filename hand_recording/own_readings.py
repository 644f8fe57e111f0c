"""Readings at the times at which they were taken, where these are no steady clock.

The samples of a recording lie on a uniform clock. Straight lines between readings cut the bends of a pressure after a
step, so the readings themselves are kept next to the samples; a model can be compared with them at their own times
(hand_identification/own_times.py).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array
from hand_sim.sample_ticks import ascending_ticks

ROUNDING = 1e-3
"""Part of a period by which a time may miss its sample because it was rounded."""


@dataclass(frozen=True, slots=True, eq=False)
class OwnReadings:
    """The reading that belongs to each of T samples; NaN where there is none.

    late_s: (T,) time from the sample to its reading [s], negative where it came before.  pressure_pa, angle_rad:
    (T, J), or (T,) of one joint.
    """

    late_s: Array
    pressure_pa: Array
    angle_rad: Array

    def of(self, joint: int) -> OwnReadings:
        """The readings of one joint, by its number."""
        return replace(self, pressure_pa=self.pressure_pa[:, joint], angle_rad=self.angle_rad[:, joint])

    def part(self, samples: slice) -> OwnReadings:
        """Those of some samples."""
        return OwnReadings(self.late_s[samples], self.pressure_pa[samples], self.angle_rad[samples])

    def within(self, angle_rad: float, pressure_pa: float) -> OwnReadings:
        """Those of which neither angle nor pressure is beyond a limit, as a spike is."""
        beyond = (np.abs(self.angle_rad) > angle_rad) | (np.abs(self.pressure_pa) > pressure_pa)
        kept = (np.where(beyond, np.nan, values) for values in (self.pressure_pa, self.angle_rad))
        return OwnReadings(self.late_s, *kept)


def between_samples(grid_s: Array, time_s: Array) -> bool:
    """Whether any reading, at times (N,) [s], was taken off the samples of a uniform grid (T,) [s]."""
    places = (time_s - grid_s[0]) / (grid_s[1] - grid_s[0])
    return bool(np.abs(places - np.rint(places)).max() >= ROUNDING)


def readings_of_samples(
    grid_s: Array, time_s: Array, pressure_pa: Array, angle_rad: Array, numbers: NDArray[np.int64] | None = None
) -> OwnReadings:
    """Each reading with the sample that is nearest to it in the order of both.

    grid_s: (T,) uniform [s].  time_s: (N,) rising times of the readings (N, J).  numbers: (N,) their samples, rising.
    """
    period_s = float(grid_s[1] - grid_s[0])
    places = (time_s - grid_s[0]) / period_s
    if numbers is None:
        numbers = ascending_ticks(places)
    inside = numbers < len(grid_s)
    at, late_s = numbers[inside], np.full(len(grid_s), np.nan)
    late_s[at] = period_s * (places - numbers)[inside]
    own = [np.full((len(grid_s), values.shape[1]), np.nan) for values in (pressure_pa, angle_rad)]
    for filled, values in zip(own, (pressure_pa, angle_rad), strict=True):
        filled[at] = values[inside]
    return OwnReadings(late_s, *own)
