"""Training, validation and test data of one joint, and the errors of fits on them.

Test data are one whole recording where there are SETTINGS.min_recordings_to_spare or more, else the last fifth of each.
No fit and no choice sees them: a search gets `fit_part`, and `test_part` is evaluated once, after the last choice.
Within the fit part, the blocks of joint_problem.validation_blocks make the choices. Where only the last fifth of a
recording shows something, the part before it is test data instead (`exchanged`).
No model can fit better than the noise of the reading and of the measured inputs on which a stage runs. A second draw of
the same input noise moves the predictions by as much as the first one has moved them already.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import nnls

from hand_diagnosis.settings import SETTINGS
from hand_identification.driving import shape_driving
from hand_identification.free_parameters import START_CREEP
from hand_identification.joint_data import crept, speed_at_start
from hand_identification.joint_problem import FORCE, JointProblem, Segment
from hand_identification.map_fit import MapFit
from hand_identification.settings import FITS
from hand_model.arrays import Array, Flags
from hand_model.effects.effect import ACCELERATION, ANGLE, SPEED
from hand_model.kernel.layout import CREEP, OMEGA, PHI, P
from hand_model.kernel.open_loop import OUTPUTS
from hand_model.kernel.rows import ROW
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


def spans_of_test(problem: JointProblem) -> list[tuple[int, int]]:
    """For each segment, the first sample that is test data and the one behind the last; for none, an empty span.

    They are the last ones of a segment, unless the problem spares others.
    """
    lengths = [len(segment.angle_rad) for segment in problem.segments]
    if problem.spared is not None:
        return [problem.spared]
    if len(lengths) >= SETTINGS.min_recordings_to_spare:
        return [*((n, n) for n in lengths[:-1]), (0, lengths[-1])]
    return [(_cut(segment), n) for segment, n in zip(problem.segments, lengths, strict=True)]


def exchanged(problem: JointProblem) -> JointProblem | None:
    """The problem with the part before the usual test data as test data; None where it has not one recording with some.

    What only the end of a recording shows, as a stop that creep reaches late, no model can be fitted to before it.
    """
    begin, end = spans_of_test(problem)[0]
    if len(problem.segments) != 1 or problem.spared is not None or begin >= end:
        return None
    block = problem.segments[0].block
    first = int(np.searchsorted(block, block[max(2 * begin - end, 0)]))
    return replace(problem, spared=(first, begin)) if first > 0 else None


def _cut(segment: Segment) -> int:
    """First sample of the first block that lies in the last part; the length where that part would be too short."""
    count = len(segment.angle_rad)
    wanted = round((1.0 - SETTINGS.test_share) * count)
    cut = int(np.searchsorted(segment.block, segment.block[min(wanted, count - 1)]))
    return cut if cut > 0 and (count - cut) * segment.period_s >= SETTINGS.min_test_s + FITS.settling_s else count


def stretch_of_test(problem: JointProblem) -> tuple[float, float]:
    """Begin and end [s] of the test data of the last segment that has any; (0, 0) without."""
    spans = [
        (begin * s.period_s, end * s.period_s)
        for s, (begin, end) in zip(problem.segments, spans_of_test(problem), strict=True)
        if begin < end
    ]
    return spans[-1] if spans else (0.0, 0.0)


def fit_part(problem: JointProblem) -> JointProblem:
    """The problem without its test data. Segments share memory with those of the whole problem.

    Behind test data in its middle a model runs on through them, driven by the measured inputs.
    """
    spans = spans_of_test(problem)
    kept = [_without(s, *span) for s, span in zip(problem.segments, spans, strict=True) if span[0] > 0]
    return replace(problem, segments=kept)


def _without(segment: Segment, begin: int, end: int) -> Segment:
    """A segment without its samples begin ... end - 1; where others follow, those do not count."""
    if end == len(segment.angle_rad):
        return slice_of(segment, 0, begin)
    use = segment.use.copy()
    use[:, begin:end] = False
    return replace(segment, use=use)


def slice_of(segment: Segment, begin: int, end: int) -> Segment:
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

    def clearly_worse(self, first: int, second: int, floor: Array, rng: np.random.Generator) -> bool:
        """Whether the second error of all signals, in their floors (OUTPUTS,) [SI], is larger in nearly all draws."""
        held = np.flatnonzero(self.counts.sum(axis=0) > 0)
        if len(held) < SETTINGS.min_test_blocks:
            return False
        rises = np.nansum((self.squares[second] - self.squares[first]) / floor[:, None] ** 2, axis=0)
        drawn = rng.choice(held, size=(SETTINGS.bootstrap_draws, len(held)))
        return bool(np.quantile(rises[drawn].sum(axis=1), SETTINGS.bootstrap_tail) > 0.0)


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
        end = spans_of_test(whole)[number][1]
        whole_length[:, end - residual.shape[1] : end] = np.where(segment.use, residual, np.nan)
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
    spans = spans_of_test(whole)
    numbers = [k for k, (begin, end) in enumerate(spans) if begin < end]
    if not numbers:
        return replace(problem, segments=[]), np.zeros((1, 0)), []
    shape_driving(problem, free, z)
    columns, _ = problem.columns(free, z[None])
    ratio = _creep_at_start(whole, fit)
    parts = [
        _test_segment(slice_of(problem.segments[k], 0, spans[k][1]), spans[k][0], warm_s, columns[0], ratio)
        for k in numbers
    ]
    return replace(problem, segments=parts, spared=None), columns, numbers


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
    part = slice_of(segment, begin, len(segment.angle_rad))
    use = part.use.copy()
    settling = round(FITS.settling_s / segment.period_s) if warm_s == 0.0 else 0
    use[:, : cut - begin + settling] = False
    start = segment.start.copy()
    start[CREEP] = ratio
    if begin > 0:
        start[P], start[PHI] = part.driving_pa[0], part.angle_rad[0]
        start[OMEGA] = speed_at_start(part.angle_rad, part.period_s)
        start[CREEP] = crept(segment, begin, column, ratio)
    return replace(part, use=use, start=start)


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
    tested, columns, numbers = _test_problem(whole, fit, free_axis=free_axis)
    plain = problem.predict(*problem.columns(fit.free, fit.z[None]))
    fitted = [k for k, (begin, _) in enumerate(spans_of_test(whole)) if begin > 0]
    known = {k: _laws(s, p[0]) for k, s, p in zip(fitted, problem.segments, plain, strict=True)}
    noise = np.full(OUTPUTS, np.nan)
    for number, (alone, start) in zip(numbers, _alone(tested), strict=True):
        noise = np.fmax(noise, _noise(alone, columns, start, [alone.segments[0].use], known.get(number)))
    return noise, _undetermined(whole, fit, covariance, free_axis=free_axis)


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
    laws = [noise_law(m - p, p, use) for m, p, use in zip(segment.measured, predicted, segment.use, strict=True)]
    still, by_slope = laws[FORCE]
    steep = by_slope * float(np.mean(_slopes(predicted[FORCE]) ** 2))
    laws[FORCE] = max(still, segment.kept_noise_n**2 - steep), by_slope
    return laws


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
