"""Inputs of a joint from a model and readings together: the model gives the shape, the readings what it leaves.

A pressure that turns sharply after a step is no straight line from one sample to the next, and an acceleration taken
from noisy angles alone shakes a joint that friction holds. What a model leaves of the readings is small and smooth; its
noise is reduced, gaps are bridged in it, and added to the model it is what was measured.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hand_identification.free_parameters import FreeParameter
from hand_identification.joint_problem import JointProblem, Segment
from hand_model.arrays import Array
from hand_recording.interpolation import bridge, refine
from hand_recording.signals import slopes_over, smoothing_span, white_noise, without_noise


def shape_driving(problem: JointProblem, free: Sequence[FreeParameter], z: Array) -> None:
    """Set the driving pressure of every segment by the valve's model at the coordinates z (free,).

    A segment whose readings are not smoother beside the model than by themselves stays as it is.
    """
    if problem.driven:
        return
    finer = max(1, math.ceil(problem.segments[0].period_s / problem.step_s - 1e-9))
    columns, starts = problem.columns(free, z[None])
    fine = replace(problem, segments=[_finer(segment, finer) for segment in problem.segments])
    predicted = fine.predict(columns, starts)
    problem.segments[:] = [
        _shaped(segment, one[0, 0], finer) if segment.use[0].any() else segment
        for segment, one in zip(problem.segments, predicted, strict=True)
    ]


def accelerations(problem: JointProblem, free: Sequence[FreeParameter], z: Array) -> list[Array]:
    """Acceleration (T,) [rad/s^2] of the joint in every segment, by its model at the coordinates z (free,)."""
    columns, starts = problem.columns(free, z[None])
    return [
        _acceleration(segment, predicted[0, 1])
        for segment, predicted in zip(problem.segments, problem.predict(columns, starts), strict=True)
    ]


def inflow(driving_pa: Array, samples: int, period_s: float) -> Array:
    """Rise of a driving pressure (samples,) [Pa/s], falls left out, mean over the sample around each reading."""
    if samples < 2:
        return np.zeros(samples)
    finer = (len(driving_pa) - 1) // (samples - 1)
    rises = np.maximum(np.diff(driving_pa), 0.0).reshape(samples - 1, finer).sum(axis=1) / period_s
    around = np.concatenate([rises[:1], rises, rises[-1:]])
    return np.asarray(0.5 * (around[1:] + around[:-1]))


def _acceleration(segment: Segment, model_rad: Array) -> Array:
    """Second differences keep the speed that an acceleration between two samples brings."""
    rest = _bridged(segment, segment.angle_rad - model_rad)
    span = smoothing_span(rest, segment.period_s, white_noise(rest))
    bends = np.zeros(len(rest))
    bends[1:-1] = np.diff(model_rad, 2) / segment.period_s**2
    return bends + slopes_over(rest, span, 2, segment.period_s)


def _bridged(segment: Segment, rest: Array) -> Array:
    return bridge(np.where(segment.known, rest, np.nan))[0] if segment.known.any() else rest


def _finer(segment: Segment, finer: int) -> Segment:
    """The inputs of the valve's stage alone, in steps of a `finer`-th of a sample."""
    pressure = refine(segment.pressure_pa, finer)
    return replace(
        segment,
        period_s=segment.period_s / finer,
        set_point_pa=np.repeat(segment.set_point_pa, finer)[: len(pressure)],
        driving_pa=pressure,
        exogenous=refine(segment.exogenous, finer),
    )


def _shaped(segment: Segment, model_pa: Array, finer: int) -> Segment:
    rest = _bridged(segment, segment.pressure_pa - model_pa[::finer])
    if len(rest) < 3 or not np.mean(np.diff(rest, 2) ** 2) < np.mean(np.diff(segment.pressure_pa, 2) ** 2):
        return segment
    quiet, span = without_noise(rest, segment.period_s, white_noise(rest))
    return replace(segment, driving_pa=model_pa + refine(quiet, finer), span=span, smoothed=quiet != rest)
