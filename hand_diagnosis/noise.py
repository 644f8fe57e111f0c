"""What no model's error can be below: the noise of the reading, and that of the measured inputs on which a stage runs.

A second draw of the same input noise moves the predictions by as much as the first one has moved them already. On test
data, what the fit part leaves undetermined of the parameters comes in addition.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.optimize import nnls

from hand_diagnosis.settings import SETTINGS
from hand_diagnosis.splits import alone_each, spans_of_test, tested_problem
from hand_identification.joint_problem import JointProblem, Segment
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array, Flags
from hand_model.effects.effect import ACCELERATION, ANGLE, SPEED
from hand_model.kernel.open_loop import OUTPUTS
from hand_model.kernel.rows import ROW
from hand_recording.interpolation import refine
from hand_recording.local_smoothing import smoothed_by
from hand_recording.signals import derivatives, white_noise


def noise_on(problem: JointProblem, fit: MapFit, chosen: Flags | None = None) -> Array:
    """Error (OUTPUTS,) [Pa, rad, N] that no model can be below on the chosen blocks (blocks,), or on all of them.

    Of the reading, and of the inputs; of several recordings the noisiest reading. NaN where too few samples count.
    """
    columns, starts = problem.columns(fit.free, fit.z[None])
    blocks = np.ones(problem.blocks, dtype=bool) if chosen is None else chosen
    counts = [segment.use & blocks[segment.block] for segment in problem.segments]
    return _noise(problem, columns, starts, counts)


def noise_on_test(
    whole: JointProblem, problem: JointProblem, fit: MapFit, covariance: Array, *, free_axis: bool
) -> tuple[Array, Array]:
    """Errors (OUTPUTS,) [Pa, rad, N] on test data: what no model can be below, and what the fit leaves undetermined.

    problem: the fit part.  covariance: (free, free) of the coordinates of the fit. NaN where too few samples are test
    data.
    """
    tested, columns, numbers = tested_problem(whole, fit, free_axis=free_axis)
    plain = problem.predict(*problem.columns(fit.free, fit.z[None]))
    fitted = [k for k, (begin, _) in enumerate(spans_of_test(whole)) if begin > 0]
    known = {k: _laws(s, p[0]) for k, s, p in zip(fitted, problem.segments, plain, strict=True)}
    noise = np.full(OUTPUTS, np.nan)
    for number, (alone, start) in zip(numbers, alone_each(tested), strict=True):
        noise = np.fmax(noise, _noise(alone, columns, start, [alone.segments[0].use], known.get(number)))
    return noise, _undetermined(whole, fit, covariance, free_axis=free_axis)


def _undetermined(whole: JointProblem, fit: MapFit, covariance: Array, *, free_axis: bool) -> Array:
    """RMS (OUTPUTS,) [SI] by which predictions of test data move when parameters move as far as a fit leaves open."""
    rng = np.random.default_rng(SETTINGS.noise_seed)
    scale, axes = np.linalg.eigh(covariance)
    draws = rng.standard_normal((SETTINGS.undetermined_draws, len(fit.z))) * np.sqrt(np.maximum(scale, 0.0)) @ axes.T
    problem = tested_problem(whole, fit, free_axis=free_axis)[0]
    kept = [k for k, parameter in enumerate(fit.free) if parameter.row < len(ROW)]
    z = np.concatenate([np.zeros((1, len(kept))), draws[:, kept]]) + fit.z[kept]
    moved, _ = problem.columns([fit.free[k] for k in kept], z)
    squares, count = np.zeros((len(draws), OUTPUTS)), np.zeros(OUTPUTS)
    for alone, start in alone_each(problem):
        use = alone.segments[0].use
        predicted = alone.predict(moved, np.repeat(start, len(moved), axis=0))[0]
        squares += np.sum((predicted[1:] - predicted[0]) ** 2 * use, axis=2)
        count += use.sum(axis=1)
    # A draw far outside what the data allow may diverge: the median does not see it.
    return np.asarray(np.sqrt(np.median(np.nan_to_num(squares, nan=np.inf), axis=0) / np.maximum(count, 1.0)))


def _noise(
    problem: JointProblem,
    columns: Array,
    starts: Array,
    counts: Sequence[Flags],
    known: Sequence[tuple[float, float]] | None = None,
) -> Array:
    """Noise (OUTPUTS,) [SI] of the samples that count, (OUTPUTS, T) of every segment, see `noise_on`.

    known: `_laws` of the readings; None: those of each segment, whatever part of it counts.
    """
    rng = np.random.default_rng(SETTINGS.noise_seed)
    plain = problem.predict(columns, starts)
    noisy = replace(problem, segments=[_disturbed(segment, rng, problem.driven) for segment in problem.segments])
    squares, white = np.zeros(OUTPUTS), np.full(OUTPUTS, np.nan)
    for segment, use, (first,), (second,) in zip(
        problem.segments, counts, plain, noisy.predict(columns, starts), strict=True
    ):
        squares += (((second - first) * use) ** 2).sum(axis=1)
        laws = known or _laws(segment, first)
        for stage, (still, by_slope) in enumerate(laws):
            if use[stage].sum() <= SETTINGS.min_stage_samples:
                continue
            own = float(np.sqrt(still + by_slope * np.mean(_slopes(first[stage])[use[stage]] ** 2)))
            white[stage] = np.fmax(white[stage], own)
    total = np.sum([use.sum(axis=1) for use in counts], axis=0)
    return np.asarray(np.hypot(white, np.sqrt(squares / np.maximum(total, 1.0))))


def _laws(segment: Segment, predicted: Array) -> list[tuple[float, float]]:
    """`noise_law` of every reading of a segment, by its predictions (OUTPUTS, T)."""
    return [noise_law(m - p, p, use) for m, p, use in zip(segment.measured, predicted, segment.use, strict=True)]


def _slopes(predicted: Array) -> Array:
    """Change of a prediction (T,) within a sample, without its sign."""
    return np.asarray(np.abs(np.gradient(predicted))) if len(predicted) > 1 else np.zeros(len(predicted))


def noise_law(residual: Array, predicted: Array, use: Flags) -> tuple[float, float]:
    """Variance [SI^2] of the white part of a residual (T,) at rest, and its growth with the squared slope [samples^2].

    A sample taken at a wrong time is wrong by the speed of the signal times the time. use: (T,) samples that count.
    They are parted by the slope of the prediction (T,); in a part, third differences separate noise from structure.
    """
    inside = use[3:] & use[2:-1] & use[1:-2] & use[:-3]
    white = white_noise(residual, use)
    if inside.sum() < SETTINGS.noise_part_samples * SETTINGS.noise_parts[-1]:
        return white**2, 0.0
    slope = _slopes(predicted)
    slope = np.maximum(slope[1:-2], slope[2:-1])[inside]
    rough = np.abs(np.diff(residual, 3))[inside] / np.sqrt(SETTINGS.third_difference_variance)
    order = np.argsort(slope, kind="stable")
    ends = [len(order) * (k - 1) // k for k in SETTINGS.noise_parts]
    parts = [order[begin:end] for begin, end in pairwise([*ends, len(order)])]
    median = [float(np.median(rough[part])) / SETTINGS.median_of_noise for part in parts]
    if min(median) <= 0.0:
        return white**2, 0.0
    rows = np.array([[1.0, float(np.median(slope[part])) ** 2] for part in parts]) / np.square(median)[:, None]
    still, by_slope = nnls(rows, np.ones(len(rows)))[0]
    # Steps change by more within a sample than their slope says: what the parts show together is the least.
    shown = max(white**2, sum(len(part) * m * m for part, m in zip(parts, median, strict=True)) / len(order))
    scale = max(shown / max(float(still + by_slope * np.mean(slope**2)), 1e-300), 1.0)
    return scale * float(still), scale * float(by_slope)


def _disturbed(segment: Segment, rng: np.random.Generator, driven: bool) -> Segment:
    """The segment with a second draw of the noise on its inputs, smoothed as the first one was."""
    white = white_noise(segment.pressure_pa) * rng.standard_normal(len(segment.pressure_pa))
    kept = white if driven else smoothed_by(white, segment.windows)
    kept = kept + _moved(segment.pressure_pa, segment, rng)
    finer = (len(segment.driving_pa) - 1) // (len(kept) - 1)
    angle = white_noise(segment.angle_rad) * rng.standard_normal(len(white)) + _moved(segment.angle_rad, segment, rng)
    speed, acceleration = derivatives(angle[:, None], segment.period_s, segment.derivative_s)
    exogenous = segment.exogenous.copy()
    exogenous[:, ANGLE] += angle
    exogenous[:, SPEED] += speed[:, 0]
    exogenous[:, ACCELERATION] += acceleration[:, 0]
    return replace(segment, driving_pa=segment.driving_pa + refine(kept, finer), exogenous=exogenous)


def _moved(values: Array, segment: Segment, rng: np.random.Generator) -> Array:
    """Errors (T,) of a signal whose samples were taken at slightly wrong times: its speed times the jitter."""
    if segment.jitter_s == 0.0:
        return np.zeros(len(values))
    return np.gradient(values, segment.period_s) * segment.jitter_s * rng.standard_normal(len(values))
