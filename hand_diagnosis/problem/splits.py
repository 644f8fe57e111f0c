"""Training, validation and test data of one joint, and the errors of fits on them.

Test data are one whole recording where there are SETTINGS.min_recordings_to_spare or more, else the last fifth of each.
No fit and no choice sees them: a search gets `fit_part`, and `test_part` is evaluated once, after the last choice.
Within the fit part, the blocks of joint_problem.validation_blocks make the choices. Where only the last fifth of a
recording shows something, the part before it is test data instead (`exchanged`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hand_diagnosis.problem.noise import noise_laws, noise_of
from hand_diagnosis.settings import SETTINGS
from hand_identification.driving import shape_driving
from hand_identification.free_parameters import START_CREEP
from hand_identification.joint_data import crept, speed_at_start
from hand_identification.joint_problem import JointProblem, Segment
from hand_identification.map_fit import MapFit
from hand_identification.settings import FITS
from hand_model.arrays import Array, Flags
from hand_model.kernel.layout import CREEP, OMEGA, PHI, P
from hand_model.kernel.open_loop import OUTPUTS
from hand_model.kernel.rows import ROW
from hand_recording.signals import Signals


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


def redrawn(problem: JointProblem) -> JointProblem:
    """The problem with other validation blocks. What only these blocks show, no model can be fitted to without them."""
    return replace(problem, draw=problem.draw + 1)


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
        loose=None if segment.loose is None else segment.loose[begin : end - 1],
        own=None if segment.own is None else segment.own.part(part),
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
    return noise_of(problem, columns, starts, counts)


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
    known = {k: noise_laws(s, p[0]) for k, s, p in zip(fitted, problem.segments, plain, strict=True)}
    noise = np.full(OUTPUTS, np.nan)
    for number, (alone, start) in zip(numbers, _alone(tested), strict=True):
        noise = np.fmax(noise, noise_of(alone, columns, start, [alone.segments[0].use], known.get(number)))
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
