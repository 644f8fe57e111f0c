"""Inputs of a joint's model, from the prediction of the stage before it and the readings together.

Between two samples a pressure that bends sharply after a step is not a straight line, and an acceleration computed from
noisy angles alone shakes a joint that friction holds. The residual of a model, on the other hand, is small and smooth.
So the residual's noise is reduced, where it is only noise all of it, its gaps are bridged, and the prediction is added
to it again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hand_identification.free_parameters import FreeParameter
from hand_identification.joint_problem import JointProblem, Segment
from hand_identification.own_times import fine_readings, on_samples, roughness
from hand_identification.step_times import place_steps
from hand_model.arrays import Array
from hand_model.effects.effect import PARTNER
from hand_model.kernel.layout import resting_states
from hand_recording.interpolation import bridge, refine
from hand_recording.local_smoothing import NOISE, Windows, local_windows, smoothed_by
from hand_recording.signals import slopes_over, smoothing_span, white_noise


def shape_driving(problem: JointProblem, free: Sequence[FreeParameter], z: Array) -> None:
    """Set the driving pressure of every segment from the valve's model at the coordinates z (free,) [-].

    Readings between the samples are put on them by the model first. A segment is left as it is where the residual of
    the model is not smoother than the readings themselves.
    """
    if problem.driven:
        return
    place_steps(problem, free, z)
    finer, readings = fine_readings(problem, free, z)
    placed = [on_samples(segment, fine, finer) for segment, fine in zip(problem.segments, readings, strict=True)]
    problem.segments[:] = [
        _shaped(segment, fine[0], finer) if segment.use[0].any() else segment
        for segment, fine in zip(placed, readings, strict=True)
    ]


def accelerations(problem: JointProblem, free: Sequence[FreeParameter], z: Array) -> list[Array]:
    """Acceleration (T,) [rad/s^2] of the joint in every segment, from its model at the coordinates z (free,)."""
    columns, starts = problem.columns(free, z[None])
    return [
        _acceleration(segment, predicted[0, 1])
        for segment, predicted in zip(problem.segments, problem.predict(columns, starts), strict=True)
    ]


def speeds(problem: JointProblem, free: Sequence[FreeParameter], z: Array) -> list[Array]:
    """Speed (T,) [rad/s] of the joint in every segment, as `accelerations`."""
    columns, starts = problem.columns(free, z[None])
    return [
        _speed(segment, predicted[0, 1])
        for segment, predicted in zip(problem.segments, problem.predict(columns, starts), strict=True)
    ]


def shaken(problem: JointProblem, other: Array, by_rad_s2: Sequence[Array]) -> list[Array]:
    """Acceleration (T,) [rad/s^2] in every segment of a vented joint at rest that only its partner moves (Eq. 8).

    other: (rows,) its parameters.  by_rad_s2: acceleration (T,) of the partner, which is the joint of the problem.
    """
    segments = []
    for segment, acceleration in zip(problem.segments, by_rad_s2, strict=True):
        exogenous = np.zeros_like(segment.exogenous)
        exogenous[:, PARTNER] = acceleration
        vented = replace(
            segment,
            commanded_pa=np.zeros_like(segment.commanded_pa),
            driving_pa=np.zeros_like(segment.driving_pa),
            exogenous=exogenous,
            start=resting_states(other),
            acts=None,
            added=None,
        )
        segments.append(vented)
    alone = replace(problem, segments=segments)
    starts = np.zeros((1, 1 + len(segments)))
    return [
        _second_differences(predicted[0, 1], segment.period_s)
        for predicted, segment in zip(alone.predict(other[None], starts), segments, strict=True)
    ]


def inflow(driving_pa: Array, samples: int, period_s: float) -> Array:
    """Rate of rise (samples,) [Pa/s] of a driving pressure, averaged over the sample around each reading; falls are 0.

    driving_pa: (finer (samples - 1) + 1,) [Pa gauge], evenly spaced over the samples.
    """
    if samples < 2:
        return np.zeros(samples)
    finer = (len(driving_pa) - 1) // (samples - 1)
    rises = np.maximum(np.diff(driving_pa), 0.0).reshape(samples - 1, finer).sum(axis=1) / period_s
    around = np.concatenate([rises[:1], rises, rises[-1:]])
    return np.asarray(0.5 * (around[1:] + around[:-1]))


def _acceleration(segment: Segment, model_rad: Array) -> Array:
    """Second differences of the model's angles, whose sum is the change of speed, plus the residual's acceleration."""
    residual = _bridged(segment, segment.angle_rad - model_rad)
    span = smoothing_span(residual, segment.period_s, white_noise(residual))
    bends = _second_differences(model_rad, segment.period_s)
    left = slopes_over(residual, span, 2, segment.period_s)
    return bends + np.where(_windows(segment, residual, model_rad) == NOISE, 0.0, left)


def _speed(segment: Segment, model_rad: Array) -> Array:
    """Slope of the model's angles plus that of the residual where it is more than noise."""
    residual = _bridged(segment, segment.angle_rad - model_rad)
    span = smoothing_span(residual, segment.period_s, white_noise(residual))
    left = slopes_over(residual, span, 1, segment.period_s)
    noise = _windows(segment, residual, model_rad) == NOISE
    return np.asarray(np.gradient(model_rad, segment.period_s) + np.where(noise, 0.0, left))


def _second_differences(angle_rad: Array, period_s: float) -> Array:
    """(T,) [rad/s^2]; 0 at both ends."""
    bends = np.zeros(len(angle_rad))
    bends[1:-1] = np.diff(angle_rad, 2) / period_s**2
    return bends


def _bridged(segment: Segment, residual: Array) -> Array:
    return bridge(np.where(segment.known, residual, np.nan))[0] if segment.known.any() else residual


def _shaped(segment: Segment, model_pa: Array, finer: int) -> Segment:
    residual = _bridged(segment, segment.pressure_pa - model_pa[::finer])
    if not roughness(residual, segment.use[0]) < roughness(segment.pressure_pa, segment.use[0]):
        return segment
    windows = _windows(segment, residual, model_pa[::finer])
    return replace(segment, driving_pa=model_pa + refine(smoothed_by(residual, windows), finer), windows=windows)


def _windows(segment: Segment, residual: Array, model: Array) -> Windows:
    """Windows of the smoothing of a model's residual (T,), whose noise grows with the model's speed by the jitter."""
    noise = np.hypot(white_noise(residual), segment.jitter_s * np.gradient(model, segment.period_s))
    return local_windows(residual, segment.period_s, noise)
