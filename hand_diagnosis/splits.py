"""Training, validation and test data of one joint: the errors of fits on them, and what no model's error can be below.

Test data are one whole recording where there are SETTINGS.min_recordings_to_spare or more, else the last fifth of each.
No fit and no choice sees them: a search gets `fit_part`, and `test_part` is evaluated once, after the last choice.
Within the fit part, validation blocks make the choices (joint_problem.held_out_blocks).

No model can fit better than the noise of the reading and the noise of the measured inputs on which a stage runs. A
second draw of the same input noise moves the predictions by as much as the first one has moved them already. On test
data, what the fit part leaves undetermined of the parameters comes in addition.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numba import njit
from scipy.optimize import nnls

from hand_diagnosis.settings import SETTINGS
from hand_identification.driving import shape_driving
from hand_identification.free_parameters import START_CREEP
from hand_identification.joint_data import speed_at_start
from hand_identification.joint_problem import SETTLING_S, JointProblem, Segment
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array, Flags
from hand_model.effects.effect import ACCELERATION, ANGLE, SPEED
from hand_model.kernel.layout import CREEP, OMEGA, PHI, P
from hand_model.kernel.open_loop import OUTPUTS
from hand_model.kernel.rows import ROW
from hand_model.material import creep_rate
from hand_recording.interpolation import refine
from hand_recording.local_smoothing import smoothed_by
from hand_recording.signals import Signals, derivatives, white_noise


def spared_last(signals: Sequence[Signals]) -> list[Signals]:
    """The recordings with the one in the middle of the list moved to its end, where `fit_part` leaves it out.

    A series often goes through a condition, as a pressure: a model is tested inside the range that it was fitted on.
    Fewer recordings than SETTINGS.min_recordings_to_spare keep their order.
    """
    if len(signals) < SETTINGS.min_recordings_to_spare:
        return list(signals)
    middle = len(signals) // 2
    return [*signals[:middle], *signals[middle + 1 :], signals[middle]]


def first_test_samples(problem: JointProblem) -> list[int]:
    """For each segment, the first sample that is test data; its length where it holds none."""
    lengths = [len(segment.angle_rad) for segment in problem.segments]
    if len(lengths) >= SETTINGS.min_recordings_to_spare:
        return [*lengths[:-1], 0]
    return [_cut(segment) for segment in problem.segments]


def _cut(segment: Segment) -> int:
    """First sample of the first block that lies in the last part; the length where that part would be too short."""
    count = len(segment.angle_rad)
    wanted = round((1.0 - SETTINGS.test_share) * count)
    cut = int(np.searchsorted(segment.block, segment.block[min(wanted, count - 1)]))
    return cut if cut > 0 and (count - cut) * segment.period_s >= SETTINGS.min_test_s + SETTLING_S else count


def stretch_of_test(problem: JointProblem) -> tuple[float, float]:
    """Begin and end [s] of the test data of the last segment that has any; (0, 0) without."""
    spans = [
        (cut * s.period_s, len(s.angle_rad) * s.period_s)
        for s, cut in zip(problem.segments, first_test_samples(problem), strict=True)
        if cut < len(s.angle_rad)
    ]
    return spans[-1] if spans else (0.0, 0.0)


def fit_part(problem: JointProblem) -> JointProblem:
    """The problem without its test data. Segments share memory with those of the whole problem."""
    cuts = first_test_samples(problem)
    kept = [_slice(s, 0, cut) for s, cut in zip(problem.segments, cuts, strict=True) if cut > 0]
    return replace(problem, segments=kept)


def beginning(problem: JointProblem, samples: int) -> JointProblem:
    """The problem with at most about so many samples in all, the same share of each segment from its beginning."""
    total = sum(len(segment.angle_rad) for segment in problem.segments)
    if total <= samples:
        return problem
    return replace(
        problem, segments=[_slice(s, 0, max(len(s.angle_rad) * samples // total, 2)) for s in problem.segments]
    )


def _slice(segment: Segment, begin: int, end: int) -> Segment:
    """Samples begin ... end - 1 of a segment."""
    samples = len(segment.angle_rad)
    finer, parts = ((len(fine) - 1) // (samples - 1) for fine in (segment.driving_pa, segment.commanded_pa))
    part = slice(begin, end)
    return replace(
        segment,
        set_point_pa=segment.set_point_pa[part],
        commanded_pa=segment.commanded_pa[parts * begin : parts * (end - 1) + 1],
        pressure_pa=segment.pressure_pa[part],
        driving_pa=segment.driving_pa[finer * begin : finer * (end - 1) + 1],
        windows=segment.windows[part],
        angle_rad=segment.angle_rad[part],
        force_n=segment.force_n[part],
        exogenous=segment.exogenous[part],
        known=segment.known[part],
        use=segment.use[:, part],
        block=segment.block[part],
        acts=None if segment.acts is None else segment.acts[part],
    )


@dataclass(frozen=True, slots=True)
class ErrorsOnTest:
    """Errors on the test data, SI: sums of squares (OUTPUTS, blocks) of several fits, and samples (OUTPUTS, blocks)."""

    squares: tuple[Array, ...]
    counts: Array

    def rmse(self, fit: int) -> Array:
        """RMS error (OUTPUTS,) [Pa, rad, N] of the fit of that number; NaN for a signal without test data."""
        total = self.counts.sum(axis=1)
        return np.sqrt(np.where(total > 0, self.squares[fit].sum(axis=1) / np.maximum(total, 1.0), np.nan))

    def clearly_worse(self, first: int, second: int, stage: int, rng: np.random.Generator) -> bool:
        """Whether the second fit's error is larger than the first one's in nearly all draws of the blocks."""
        held = np.flatnonzero(self.counts[stage] > 0)
        if len(held) < SETTINGS.min_test_blocks:
            return False
        drawn = rng.choice(held, size=(SETTINGS.bootstrap_draws, len(held)))
        rise = (self.squares[second][stage] - self.squares[first][stage])[drawn].sum(axis=1)
        return bool(np.quantile(rise, SETTINGS.bootstrap_tail) > 0.0)


def evaluate_test(whole: JointProblem, fits: Sequence[MapFit], *, free_axis: bool) -> ErrorsOnTest | None:
    """Errors of fits on the test data of a problem; None where it has none.

    free_axis: nothing but its inertia ties the state to its past, so it is estimated at its first test sample.
    Otherwise it is estimated a little earlier, and a stretch lets the memory of the model's effects settle.
    """
    squares, counts = [], np.zeros((0, 0))
    for fit in fits:
        problem, columns, _ = _test_problem(whole, fit, free_axis=free_axis)
        if not problem.segments:
            return None
        squares.append(_squares(problem, columns))
        counts = problem.block_counts
    return ErrorsOnTest(tuple(squares), counts)


def residuals_on_test(whole: JointProblem, fit: MapFit, *, free_axis: bool) -> list[tuple[int, Array]]:
    """What `evaluate_test` squares: for each segment with test data its number and residuals (OUTPUTS, T), SI.

    NaN at samples that are no test data or do not count.
    """
    problem, columns, numbers = _test_problem(whole, fit, free_axis=free_axis)
    found = []
    for number, segment, (alone, start) in zip(numbers, problem.segments, _alone(problem), strict=True):
        residual = alone.residuals(columns, start)[0][0]
        whole_length = np.full(whole.segments[number].use.shape, np.nan)
        whole_length[:, -residual.shape[1] :] = np.where(segment.use, residual, np.nan)
        found.append((number, whole_length))
    return found


def predict_test(whole: JointProblem, fit: MapFit, *, free_axis: bool) -> list[tuple[Segment, Array]]:
    """Segments with test data, of which only these count, and their predictions (OUTPUTS, T) by a fit [SI].

    free_axis: see `evaluate_test`. Empty where the problem has no test data.
    """
    problem, columns, _ = _test_problem(whole, fit, free_axis=free_axis)
    return [(part.segments[0], part.predict(columns, start)[0][0]) for part, start in _alone(problem)]


def swings_freely(problem: JointProblem) -> bool:
    """Whether nothing but damping ties an axis to its input: no elasticity, so an old state is never forgotten."""
    stiffness = abs(float(problem.nominal[ROW["statics.a1_nm_per_rad"]]))
    return not problem.driven and stiffness <= SETTINGS.min_elasticity_nm_per_rad


def _test_problem(whole: JointProblem, fit: MapFit, *, free_axis: bool) -> tuple[JointProblem, Array, list[int]]:
    """The test data as a problem, the parameters (1, rows) of a fit, and the numbers of the segments with test data."""
    warm_s = 0.0 if free_axis else SETTINGS.test_warm_up_s
    free = [parameter for parameter in fit.free if parameter.row < len(ROW)]
    z = np.array([z for parameter, z in zip(fit.free, fit.z, strict=True) if parameter.row < len(ROW)])
    problem = replace(whole, segments=list(whole.segments))
    cuts = first_test_samples(whole)
    numbers = [k for k, segment in enumerate(whole.segments) if cuts[k] < len(segment.angle_rad)]
    if not numbers:
        return replace(problem, segments=[]), np.zeros((1, 0)), []
    shape_driving(problem, free, z)
    columns, _ = problem.columns(free, z[None])
    ratio = _creep_at_start(whole, fit)
    parts = [_test_segment(problem.segments[k], cuts[k], warm_s, columns[0], ratio) for k in numbers]
    return replace(problem, segments=parts), columns, numbers


def _alone(problem: JointProblem) -> Iterator[tuple[JointProblem, Array]]:
    """Each segment as a problem of its own, with its own creeping ratio and speed at its start (1, 2)."""
    for segment in problem.segments:
        yield replace(problem, segments=[segment]), np.array([[segment.start[CREEP], segment.start[OMEGA]]])


def _squares(problem: JointProblem, columns: Array) -> Array:
    """Sums of squared residuals (OUTPUTS, blocks); each segment has its own creeping ratio at its start."""
    total = np.zeros(problem.block_counts.shape)
    for alone, start in _alone(problem):
        own = alone.block_squares(alone.residuals(columns, start))[0]
        total[:, : own.shape[1]] += own
    return total


def _creep_at_start(whole: JointProblem, fit: MapFit) -> float:
    """The creeping ratio [-] at the start of the recordings that a fit found."""
    for parameter, z in zip(fit.free, fit.z, strict=True):
        if parameter.row == START_CREEP:
            return float(parameter.value(np.array([z]))[0])
    return float(whole.starts(1)[0, 0])


def _test_segment(segment: Segment, cut: int, warm_s: float, column: Array, ratio: float) -> Segment:
    """The test samples of a segment behind a stretch that is not evaluated, with the state estimated at their start."""
    begin = max(0, cut - round(warm_s / segment.period_s))
    if begin > 0:
        begin = int(np.searchsorted(segment.block, segment.block[begin]))
    part = _slice(segment, begin, len(segment.angle_rad))
    use = part.use.copy()
    settling = round(SETTLING_S / segment.period_s) if warm_s == 0.0 else 0
    use[:, : cut - begin + settling] = False
    start = segment.start.copy()
    start[CREEP] = ratio
    if begin > 0:
        start[P], start[PHI] = part.driving_pa[0], part.angle_rad[0]
        start[OMEGA] = speed_at_start(part.angle_rad, part.period_s)
        start[CREEP] = _crept(segment, begin, column, ratio)
    return replace(part, use=use, start=start)


def _crept(segment: Segment, end: int, column: Array, ratio: float) -> float:
    """The creeping ratio [-] at a sample, from the measured pressures before it (Eq. 12)."""
    keys = ("p_min_pa", "b1_per_pa", "extension_time_s", "b0_per_pa", "recovery_time_s")
    p_min, b1, extension_s, b0, recovery_s = (float(column[ROW[f"material.{key}"]]) for key in keys)
    rates = (1.0 / extension_s, b0, 1.0 / recovery_s)
    return float(_creep(segment.pressure_pa[:end], ratio, segment.period_s, p_min, b1, *rates))


@njit(cache=True)
def _creep(pressure, ratio, period_s, p_min, b1, extension_rate, b0, recovery_rate):  # type: ignore[no-untyped-def]
    for p in pressure:
        ratio += period_s * creep_rate(p, ratio, p_min, b1, extension_rate, b0, recovery_rate)
    return ratio


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
) -> Array:
    """Error (OUTPUTS,) [Pa, rad, N] that no test error of the fit's model can be expected below.

    problem: the fit part.  covariance: (free, free) of the coordinates of the fit. NaN where too few samples are test
    data.
    """
    tested, columns, numbers = _test_problem(whole, fit, free_axis=free_axis)
    plain = problem.predict(*problem.columns(fit.free, fit.z[None]))
    fitted = [k for k, cut in enumerate(first_test_samples(whole)) if cut > 0]
    known = {k: _laws(s, p[0]) for k, s, p in zip(fitted, problem.segments, plain, strict=True)}
    noise = np.full(OUTPUTS, np.nan)
    for number, (alone, start) in zip(numbers, _alone(tested), strict=True):
        noise = np.fmax(noise, _noise(alone, columns, start, [alone.segments[0].use], known.get(number)))
    return np.asarray(np.hypot(noise, _undetermined(whole, fit, covariance, free_axis=free_axis)))


def _undetermined(whole: JointProblem, fit: MapFit, covariance: Array, *, free_axis: bool) -> Array:
    """RMS (OUTPUTS,) [SI] by which predictions of test data move when parameters move as far as a fit leaves open."""
    rng = np.random.default_rng(SETTINGS.noise_seed)
    scale, axes = np.linalg.eigh(covariance)
    draws = rng.standard_normal((SETTINGS.undetermined_draws, len(fit.z))) * np.sqrt(np.maximum(scale, 0.0)) @ axes.T
    problem = _test_problem(whole, fit, free_axis=free_axis)[0]
    kept = [k for k, parameter in enumerate(fit.free) if parameter.row < len(ROW)]
    z = np.concatenate([np.zeros((1, len(kept))), draws[:, kept]]) + fit.z[kept]
    moved, _ = problem.columns([fit.free[k] for k in kept], z)
    squares, count = np.zeros((len(draws), OUTPUTS)), np.zeros(OUTPUTS)
    for alone, start in _alone(problem):
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
