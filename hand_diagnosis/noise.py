"""What the noise of the measured inputs does to the predictions: no model can fit better than that.

A stage runs on what was measured at its input (chain.py), noise included. A second draw of the same noise, added to
the inputs, moves the predictions by as much as the first one has moved them already.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hand_identification.joint_problem import JointProblem, Segment
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array
from hand_model.chain import OUTPUTS
from hand_model.effects.effect import ACCELERATION, ANGLE, SPEED
from hand_recording.signals import derivatives, smoothed_over, white_noise

SEED = 20
PARTS = (1, 2, 5, 10, 20)
"""The fastest half, fifth, tenth and twentieth of the samples are looked at apart."""


def noise_of_inputs(problem: JointProblem, fit: MapFit) -> Array:
    """RMS (OUTPUTS,), SI, by which input noise moves the predictions of a fit on held-out blocks."""
    rng = np.random.default_rng(SEED)
    columns, starts = problem.columns(fit.free, fit.z[None])
    plain = problem.predict(columns, starts)
    noisy = replace(problem, segments=[_disturbed(segment, rng, problem.driven) for segment in problem.segments])
    squares, count = np.zeros(OUTPUTS), np.zeros(OUTPUTS)
    for segment, one, other in zip(problem.segments, plain, noisy.predict(columns, starts), strict=True):
        counts = segment.use & problem.held_out[segment.block]
        squares += (((other[0] - one[0]) * counts) ** 2).sum(axis=1)
        count += counts.sum(axis=1)
    return np.asarray(np.sqrt(squares / np.maximum(count, 1.0)), dtype=np.float64)


def noise_of_reading(residual: Array, predicted: Array) -> float:
    """RMS (T,) of the white part of a residual, SI, which may grow with the speed of the signal, as jitter makes it.

    Samples are parted by the slope of the prediction; within a part, third differences tell noise from structure.
    """
    if len(residual) < 4 * PARTS[-1]:
        return white_noise(residual)
    slope = np.abs(np.gradient(predicted))
    slope = np.maximum(slope[1:-2], slope[2:-1])
    rough = np.abs(np.diff(residual, 3)) / np.sqrt(20.0)
    order = np.argsort(slope, kind="stable")
    parts = [order[len(order) * (k - 1) // k :] for k in PARTS[1:]]
    rest, square = len(order), 0.0
    for part, smaller in zip([order, *parts], [*parts, order[:0]], strict=True):
        inside = np.setdiff1d(part, smaller, assume_unique=True)
        square += len(inside) * (float(np.median(rough[inside])) / 0.6745) ** 2
    return max(float(np.sqrt(square / rest)), white_noise(residual))


def _disturbed(segment: Segment, rng: np.random.Generator, driven: bool) -> Segment:
    """The segment with a second draw of the noise on its inputs, treated as the first one was."""
    white = white_noise(segment.pressure_pa) * rng.standard_normal(len(segment.pressure_pa))
    kept = white if driven else np.where(segment.smoothed, smoothed_over(white, segment.span), white)
    samples = np.arange(len(kept))
    kept = np.interp(np.linspace(0.0, samples[-1], len(segment.driving_pa)), samples, kept)
    angle = white_noise(segment.angle_rad) * rng.standard_normal(len(white))
    speed, acceleration = derivatives(angle[:, None], segment.period_s)
    exogenous = segment.exogenous.copy()
    exogenous[:, ANGLE] += angle
    exogenous[:, SPEED] += speed[:, 0]
    exogenous[:, ACCELERATION] += acceleration[:, 0]
    return replace(segment, driving_pa=segment.driving_pa + kept, exogenous=exogenous)
