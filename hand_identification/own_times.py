"""Readings that were taken between the samples, put on the samples by what a model leaves of them.

After a step a pressure bends within a sample, and a straight line between two readings cuts the bend. What a model
leaves of the readings, each at its own time, is smooth: straight lines go between these rests, and the model is added
again (a deferred correction, Pereyra, Numer. Math. 8, 1966).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hand_identification.free_parameters import FreeParameter
from hand_identification.joint_problem import JointProblem, Segment
from hand_model.arrays import Array, Flags
from hand_recording.interpolation import refine


def put_on_samples(problem: JointProblem, free: Sequence[FreeParameter], z: Array) -> None:
    """Put the readings of every segment on its samples by the model at the coordinates z (free,) [-], in place."""
    if any(segment.own is not None for segment in problem.segments):
        finer, readings = fine_readings(problem, free, z)
        problem.segments[:] = [on_samples(s, fine, finer) for s, fine in zip(problem.segments, readings, strict=True)]


def fine_readings(problem: JointProblem, free: Sequence[FreeParameter], z: Array) -> tuple[int, list[Array]]:
    """How many parts a sample has, and the model's readings at each (OUTPUTS, parts (T - 1) + 1), SI, of every segment.

    z: (free,) coordinates [-].
    """
    finer = math.lcm(*(segment.parts for segment in problem.segments))
    finer *= max(1, math.ceil(problem.segments[0].period_s / finer / problem.step_s - 1e-9))
    fine = replace(problem, segments=[_finer(segment, finer) for segment in problem.segments])
    return finer, [predicted[0] for predicted in fine.predict(*problem.columns(free, z[None]))]


def _finer(segment: Segment, finer: int) -> Segment:
    """The segment with the inputs of both stages in steps of a `finer`-th of a sample; other signals stay."""
    given = (len(segment.driving_pa) - 1) // max(len(segment.angle_rad) - 1, 1)
    driving = (segment.pressure_pa, finer) if finer % given else (segment.driving_pa, finer // given)
    pressure = refine(*driving)
    return replace(
        segment,
        period_s=segment.period_s / finer,
        set_point_pa=np.repeat(segment.set_point_pa, finer)[: len(pressure)],
        commanded_pa=np.repeat(segment.commanded_pa, finer // segment.parts)[: len(pressure)],
        driving_pa=pressure,
        exogenous=refine(segment.exogenous, finer),
        acts=None if segment.acts is None else np.repeat(segment.acts, finer)[: len(pressure)],
    )


def on_samples(segment: Segment, model: Array, finer: int) -> Segment:
    """The segment with pressures and angles put on its samples by what a model leaves of its readings.

    model: (OUTPUTS, parts) readings of the model, SI, at `finer` parts of each of the samples. A signal stays as it is
    where the model leaves nothing smoother than the readings themselves.
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
    """Mean square of the second differences of values (T,) [any unit] over the samples that count (T,); 0 without any.

    Where a recording begins in the middle of a step, nobody knows the commands before, which is no fault of the model.
    """
    inside = use[2:] & use[1:-1] & use[:-2]
    return float(np.mean(np.diff(values, 2)[inside] ** 2)) if inside.any() else 0.0
