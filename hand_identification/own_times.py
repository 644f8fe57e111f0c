"""Readings that were taken between the samples, put on the samples by what a model leaves of them.

After a step a pressure bends within a sample, and a straight line between two readings cuts the bend. What a model
leaves of the readings, each at its own time, is smooth: straight lines go between these rests, and the model is added
again (a deferred correction, Pereyra, Numer. Math. 8, 1966).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hand_identification.joint_problem import Segment
from hand_model.arrays import Array, Flags


def on_samples(segment: Segment, model: Array, finer: int) -> Segment:
    """The segment with pressures and angles put on its samples by a model's readings (OUTPUTS, finer (T - 1) + 1), SI.

    A signal stays as it is where the model leaves nothing smoother than the readings themselves.
    """
    own = segment.own
    if own is None:
        return segment
    place = np.arange(len(own.late_s)) + own.late_s / segment.period_s
    pressure, angle = (
        _put(values, place, readings, model[stage], finer, segment.use[stage])
        for stage, (values, readings) in enumerate(
            ((segment.pressure_pa, own.pressure_pa), (segment.angle_rad, own.angle_rad))
        )
    )
    return replace(segment, pressure_pa=pressure, angle_rad=angle)


def _put(values: Array, place: Array, readings: Array, model: Array, finer: int, use: Flags) -> Array:
    """Samples (T,) from readings (T,) at places (T,) [samples] and a model (finer (T - 1) + 1,); else `values` (T,)."""
    taken = (place >= 0.0) & (place <= len(values) - 1.0) & np.isfinite(readings)
    if taken.sum() < 2:
        return values
    at = place[taken]
    left = readings[taken] - np.interp(finer * at, np.arange(len(model)), model)
    rests = np.interp(np.arange(len(values)), at, left)
    put = model[::finer] + rests
    return put if roughness(rests, use) < roughness(values, use) else values


def roughness(values: Array, use: Flags) -> float:
    """Mean square of the second differences of values (T,) over the samples that count (T,); 0 where none does.

    Where a recording begins in the middle of a step, nobody knows the commands before, which is no fault of the model.
    """
    inside = use[2:] & use[1:-1] & use[:-2]
    return float(np.mean(np.diff(values, 2)[inside] ** 2)) if inside.any() else 0.0
