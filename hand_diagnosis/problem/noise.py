"""The noise of a joint's signals: that of each reading, and what the noise of the measured inputs adds to it.

No model can fit better than both. A second draw of the same input noise moves the predictions by as much as the first
one has moved them already.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.optimize import nnls

from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import FORCE, JointProblem, Segment
from hand_model.arrays import Array, Flags
from hand_model.effects.effect import ACCELERATION, ANGLE, SPEED
from hand_model.kernel.open_loop import OUTPUTS
from hand_recording.interpolation import refine
from hand_recording.local_smoothing import smoothed_by
from hand_recording.signals import derivatives, white_noise


def noise_of(
    problem: JointProblem,
    columns: Array,
    starts: Array,
    counts: Sequence[Flags],
    known: Sequence[tuple[float, float]] | None = None,
) -> Array:
    """Noise (OUTPUTS,) [SI] of readings and inputs on the samples that count, (OUTPUTS, T) of every segment.

    known: `noise_laws` of the readings; None: those of each segment, whatever part of it counts.
    """
    rng = np.random.default_rng(SETTINGS.noise_seed)
    plain = problem.predict(columns, starts)
    noisy = replace(problem, segments=[_disturbed(segment, rng, problem.driven) for segment in problem.segments])
    squares, white = np.zeros(OUTPUTS), np.full(OUTPUTS, np.nan)
    for segment, use, (first,), (second,) in zip(
        problem.segments, counts, plain, noisy.predict(columns, starts), strict=True
    ):
        squares += (((second - first) * use) ** 2).sum(axis=1)
        laws = known or noise_laws(segment, first)
        for stage, (still, by_slope) in enumerate(laws):
            if use[stage].sum() <= SETTINGS.min_stage_samples:
                continue
            own = float(np.sqrt(still + by_slope * np.mean(_slopes(first[stage])[use[stage]] ** 2)))
            white[stage] = np.fmax(white[stage], own)
    total = np.sum([use.sum(axis=1) for use in counts], axis=0)
    return np.asarray(np.hypot(white, np.sqrt(squares / np.maximum(total, 1.0))))


def noise_laws(segment: Segment, predicted: Array) -> list[tuple[float, float]]:
    """`noise_law` of every reading of a segment, by its predictions (OUTPUTS, T) [Pa, rad, N]."""
    laws = [noise_law(m - p, p, use) for m, p, use in zip(segment.measured, predicted, segment.use, strict=True)]
    still, by_slope = laws[FORCE]
    steep = by_slope * float(np.mean(_slopes(predicted[FORCE]) ** 2))
    laws[FORCE] = max(still, segment.kept_noise_n**2 - steep), by_slope
    shown = [segment.shown(stage) ** 2 for stage in range(OUTPUTS)]
    return [(still / share, by_slope / share) for (still, by_slope), share in zip(laws, shown, strict=True)]


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
    if by_slope > SETTINGS.noise_latest_samples**2:  # a signal that nearly always rests has no slopes to part it by
        return white**2, 0.0
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
