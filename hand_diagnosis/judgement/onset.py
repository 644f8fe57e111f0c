"""Whether an effect is there all the time, or begins or ends in a recording, and when.

The candidates come from two sides. An effect that was found is switched off in the beginning or in the end, at the time
that fits best. Where much is left, the nominal model is fitted to the beginning and to the end alone, and the time is
sought at which its error changes. At a candidate the search is repeated with all effects off on the other side. A
number of the plain plant that an effect may change is then the one that fits that side, and is free for that effect
alone. The time is refined by its profile. Both models are compared by their evidence; the one with an onset has one
parameter more, over whose values, the times of the recording, its likelihood is averaged (MacKay, Neural Computation
4(3), 1992).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hand_diagnosis.judgement.stage_errors import StageResult
from hand_diagnosis.problem import likelihood_at_most, log_evidence, most_to_gain, white_squares
from hand_diagnosis.search import JointSearch, amounts, refit_below_floor
from hand_diagnosis.settings import SETTINGS
from hand_identification.free_parameters import FreeParameter, fixed
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, map_fit
from hand_identification.settings import FITS
from hand_model.arrays import Array, Flags
from hand_model.effects.effect import Effect
from hand_model.kernel.rows import ROW


@dataclass(frozen=True, slots=True)
class Onset:
    """When the effects of a joint began (begins) or ended [s], its standard error [s], and the probability of that."""

    at_s: float
    std_s: float
    begins: bool
    probability: float

    def acts(self, samples: int, period_s: float) -> Flags:
        """Samples (samples,) at which the effects act."""
        return np.asarray((np.arange(samples) * period_s >= self.at_s) == self.begins, dtype=bool)

    @property
    def statement(self) -> str:
        """The sentence about it."""
        verb = "begins" if self.begins else "ends"
        return (
            f"It {verb} at {self.at_s:.1f} ± {self.std_s:.1g} s (probability {self.probability:.2f}, against"
            " an effect that is there all the time)."
        )


def with_onset(problem: JointProblem, onset: Onset, rows: Sequence[int]) -> JointProblem:
    """The problem of one recording in which parameters of these rows are nominal before the onset, or after the end."""
    segments = [replace(s, acts=onset.acts(len(s.angle_rad), s.period_s)) for s in problem.segments]
    return replace(problem, segments=segments, switched=tuple(rows))


def unswitched(problem: JointProblem, free: Sequence[FreeParameter], start: Array) -> tuple[list[FreeParameter], Array]:
    """Free parameters and start (free,) [-] of the model without effects; what an effect may change there is kept."""
    kept = [p.row in problem.switched for p in free]
    held = [fixed(p, float(problem.nominal[p.row]), p.scale) if keep else p for p, keep in zip(free, kept, strict=True)]
    return held, np.where(kept, 0.0, start)


def search_with_onset(
    search: JointSearch,
    results: Sequence[StageResult],
    effects: Sequence[Effect],
    again: Callable[[JointProblem, bool], JointSearch],
) -> tuple[JointSearch, Onset] | None:
    """The search with an onset, and the onset; None where effects are there all the time, or none.

    results: of the search without an onset.  again: searches a problem, with learned laws or without; textbook forms
    are enough to find a time.  Only for one recording: between recordings, no time is known.
    """
    problem = search.problem
    if len(problem.segments) != 1 or _leaves_nothing(search):
        return None
    if len(problem.segments[0].angle_rad) * problem.segments[0].period_s < SETTINGS.min_onset_recording_s:
        return None
    of_the_hand = {parameter.row for parameter in search.base.free} - {p.row for p in search.nominal.free}
    others = {ROW[key] for effect in effects for key in effect.keys}
    rows = sorted({*others, *search.own_rows} - of_the_hand)
    always = _evidence(problem, search)

    def tried(candidate: Onset) -> tuple[float, JointSearch, Onset] | None:
        return _tried(search, candidate, rows, again) if _may_surpass(search, candidate, always) else None

    best = _best([tried(candidate) for candidate in _candidates(search, results)], always)
    if best is None:
        return None
    # A time shows from both sides; the effect may as well be on the other one.
    best = _best([best, tried(replace(best[2], begins=not best[2].begins))], always) or best
    evidence, found, onset = _with_laws(replace(problem, nominal=best[1].problem.nominal), best, again, rows)
    probability = min(_probability(evidence - always), 1.0 - SETTINGS.min_probability)
    return _released(search, found), replace(onset, probability=probability)


def _leaves_nothing(search: JointSearch) -> bool:
    """Whether one effect in its textbook form leaves nothing that an onset, which has a number more, could explain.

    A learned law may imitate an effect that begins, and several effects may.
    """
    one = len(search.accepted) == 1 and not search.accepted[0].freed
    return one and most_to_gain(search.problem, search.final) < SETTINGS.min_onset_gain


def _tried(
    search: JointSearch, candidate: Onset, rows: Sequence[int], again: Callable[[JointProblem, bool], JointSearch]
) -> tuple[float, JointSearch, Onset] | None:
    """Log evidence, search and onset that a candidate leads to; None where no effect is found with it."""
    problem = replace(search.problem, nominal=_sound_side(search, candidate, rows))
    switched = with_onset(problem, candidate, rows)
    found = again(_without_change(switched, candidate), False)
    if not found.own_rows:  # what shows for a short time only is not seen without the samples around the change
        found = again(switched, False)
    if not found.own_rows and (moved := _by_leader(problem, found, candidate, rows)) is not None:
        found = again(with_onset(problem, moved, rows), False)
    if not found.own_rows:
        return None
    found, onset, evidence = _refined(problem, found, candidate, rows)
    return evidence, found, onset


def _best(
    tries: Sequence[tuple[float, JointSearch, Onset] | None], always: float
) -> tuple[float, JointSearch, Onset] | None:
    """The most evident try, where it is more probable than effects that are there all the time, of that evidence."""
    best = max((each for each in tries if each is not None), key=lambda each: each[0], default=None)
    return best if best is not None and _probability(best[0] - always) > SETTINGS.min_onset_probability else None


def _probability(gain: float) -> float:
    """Probability, 0 ... 1, of an onset that gains this log evidence."""
    odds = gain + float(np.log(SETTINGS.onset_prior))
    return float(0.5 * (1.0 + np.tanh(0.5 * odds / SETTINGS.evidence_temperature)))


def _with_laws(
    problem: JointProblem,
    best: tuple[float, JointSearch, Onset],
    again: Callable[[JointProblem, bool], JointSearch],
    rows: Sequence[int],
) -> tuple[float, JointSearch, Onset]:
    """The best search with an onset, again at the time that was found and with learned laws, if that is better.

    Its problem is without the samples around the change where they are not needed: an error of a millisecond there is
    one of degrees while the joint moves to its new place, which a law would learn.
    """
    _, _, onset = best
    switched = with_onset(problem, onset, rows)
    learned = again(_without_change(switched, onset), True)
    needed = not learned.own_rows
    if needed:
        learned = again(switched, True)
    if not learned.own_rows:
        return best
    learned, moved, evidence = _refined(problem, learned, onset, rows)
    evidence, found, onset = max((best, (evidence, learned, moved)), key=lambda each: each[0])
    return evidence, found if needed else replace(found, problem=_without_change(found.problem, onset)), onset


def _may_surpass(search: JointSearch, onset: Onset, always: float) -> bool:
    """Whether a model with an onset near this one can be more probable than effects that are there all the time.

    It has no effect on its sound side, where the best fit without one limits its likelihood; elsewhere the noise does.
    The time may still move: only the half of that side counts that is farther away from it.
    """
    segment = search.problem.segments[0]
    sound = np.flatnonzero(~onset.acts(len(segment.angle_rad), segment.period_s))
    far = np.zeros(len(segment.angle_rad), dtype=bool)
    far[sound[: len(sound) // 2] if onset.begins else sound[len(sound) // 2 :]] = True
    part = _with_only(search.problem, far)
    most = likelihood_at_most(search.problem, search.final, part, _sound_fit(search, part).squares)
    return _probability(most - always) > SETTINGS.min_onset_probability


def _sound_fit(search: JointSearch, part: JointProblem) -> MapFit:
    """The model without effects of this joint, fitted to a part of the recording."""
    base, plain = search.base, {parameter.row for parameter in search.nominal.free}
    start = np.array([0.0 if p.row in plain else z for p, z in zip(base.free, base.z, strict=True)])
    return map_fit(part, base.free, start, SETTINGS.nominal_iterations)


def _sound_side(search: JointSearch, onset: Onset, rows: Sequence[int]) -> Array:
    """Nominal parameters (rows,); those of the given rows fit the side on which no effect of this joint acts."""
    problem, segment = search.problem, search.problem.segments[0]
    sound = ~onset.acts(len(segment.angle_rad), segment.period_s)
    fit = _sound_fit(search, _with_only(problem, sound))
    nominal = problem.nominal.copy()
    nominal[list(rows)] = problem.columns(fit.free, fit.z[None])[0][0, list(rows)]
    return nominal


def _released(search: JointSearch, found: JointSearch) -> JointSearch:
    """The search with an onset in which numbers of the plain plant that no effect found changes are free at all times.

    search: that without an onset, of whose numbers these are.
    """
    plain = {p.row: p for p in search.base.free}
    kept = [row for row in found.problem.switched if row not in plain or row in found.own_rows]
    nominal, changed = search.problem.nominal.copy(), [row for row in kept if row in plain]
    nominal[changed] = found.problem.nominal[changed]
    problem = replace(found.problem, switched=tuple(kept), nominal=nominal)

    def again(fit: MapFit) -> MapFit:
        columns, _ = found.problem.columns(fit.free, fit.z[None])
        held = [p.is_fixed and p.row in plain and p.row not in changed for p in fit.free]
        free = [plain[p.row] if release else p for p, release in zip(fit.free, held, strict=True)]
        z = [
            p.coordinate(float(columns[0, p.row])) if release else value
            for p, value, release in zip(free, fit.z, held, strict=True)
        ]
        return map_fit(problem, free, np.array(z), SETTINGS.nominal_iterations)

    last = replace(found.accepted[-1], fit=refit_below_floor(problem, again(found.final)))
    return replace(found, problem=problem, nominal=again(found.nominal), accepted=[*found.accepted[:-1], last])


def _by_leader(problem: JointProblem, found: JointSearch, onset: Onset, rows: Sequence[int]) -> Onset | None:
    """The time that fits the best effect of a search that has accepted none; None where there is no other time."""
    leaders, evidence = found.rounds[-1], found.evidences[-1]
    if not leaders or leaders[0].log_evidence <= evidence:
        return None
    _, moved, _ = _refined(problem, replace(found, accepted=[leaders[0]]), onset, rows)
    return moved if abs(moved.at_s - onset.at_s) > SETTINGS.rough_onset_s else None


def _without_change(problem: JointProblem, onset: Onset) -> JointProblem:
    """The problem without the samples around a rough time, at which it is not known which plant moves the joint."""
    segment = problem.segments[0]
    times = np.arange(len(segment.angle_rad)) * segment.period_s
    return _with_only(problem, np.abs(times - onset.at_s) > SETTINGS.rough_onset_s)


def _with_only(problem: JointProblem, samples: Flags) -> JointProblem:
    """The problem of one recording in which these samples (T,) alone count."""
    segment = problem.segments[0]
    return replace(problem, segments=[replace(segment, use=segment.use & samples)])


def _evidence(problem: JointProblem, search: JointSearch) -> float:
    """Log evidence of the final model at the practical floor."""
    fit = map_fit(problem, search.final.free, search.final.z, SETTINGS.nominal_iterations)
    return log_evidence(problem, fit, amounts(fit))


def _refined(
    problem: JointProblem, found: JointSearch, onset: Onset, rows: Sequence[int]
) -> tuple[JointSearch, Onset, float]:
    """The search at the best time of the onset, that time, and the log evidence, summed over all times.

    The evidence contains the prior of an effect that begins or ends.
    """
    # Its pressure may have been shaped during the search.
    shaped = zip(found.problem.segments, problem.segments, strict=True)
    problem = replace(problem, segments=[replace(each, use=whole.use, acts=None) for each, whole in shaped])
    fit, occam = found.final, 0.0
    for _ in range(SETTINGS.onset_refinements):
        times, score = _changing(problem, fit, rows, onset)
        width = np.gradient(times)
        weights = np.exp(score - score.max()) * width
        occam = float(np.log(weights.sum() / width.sum()))
        weights /= weights.sum()
        std_s = float(np.sqrt(weights @ (times - float(times @ weights)) ** 2))
        # Between two contacts with a new obstacle, say, every time fits: then the middle one of all is stated.
        best = np.argmax(score) if std_s < SETTINGS.rough_onset_s else np.searchsorted(np.cumsum(weights), 0.5)
        onset = replace(onset, at_s=float(times[int(best)]), std_s=std_s)
        switched = with_onset(problem, onset, rows)
        fit = map_fit(switched, fit.free, fit.z, SETTINGS.nominal_iterations)
    prior = 0.0 if onset.begins else float(np.log(SETTINGS.end_prior))
    evidence = log_evidence(switched, fit, amounts(fit)) + occam + prior
    accepted = [*found.accepted[:-1], replace(found.accepted[-1], fit=fit)]
    nominal = map_fit(switched, found.nominal.free, found.nominal.z, SETTINGS.nominal_iterations)
    return replace(found, problem=switched, nominal=nominal, accepted=accepted), onset, evidence


def _changing(problem: JointProblem, fit: MapFit, rows: Sequence[int], onset: Onset) -> tuple[Array, Array]:
    """Times (n,) [s] and log likelihoods (n,) of a plant that changes there and moves on; finer near the best time."""
    segment = problem.segments[0]
    period_s, counts = segment.period_s, _independent(problem)
    columns, starts = problem.columns(fit.free, fit.z[None])
    first, last = SETTINGS.min_onset_s, len(segment.angle_rad) * period_s - SETTINGS.min_onset_s
    low, high = first, last
    left: dict[float, Array] = {}
    for _ in range(SETTINGS.onset_grids):
        times = np.unique(np.linspace(low, high, SETTINGS.onset_steps).round(decimals=9) // period_s) * period_s
        for at_s in times:
            if float(at_s) not in left:
                changes = with_onset(problem, replace(onset, at_s=float(at_s)), rows)
                left[float(at_s)] = (changes.residuals(columns, starts)[0][0] ** 2).sum(axis=1) * problem.weight
        best = max(left, key=lambda at_s: float(_likelihood(counts, left[at_s])))
        step = (high - low) / (SETTINGS.onset_steps - 1)
        low, high = max(best - step, first), min(best + step, last)
    times = np.array(sorted(left))
    squares = np.array([left[float(at_s)] for at_s in times])
    return times, _likelihood(counts, squares - np.minimum(white_squares(problem), squares.min(axis=0)))


def _both(problem: JointProblem, fit: MapFit, rows: Sequence[int]) -> tuple[Array, Array]:
    """Squared residuals (OUTPUTS, T), weighted, of a fit without an onset, and of it with those rows nominal."""
    columns, starts = problem.columns(fit.free, fit.z[None])
    off = columns.copy()
    off[:, list(rows)] = problem.nominal[list(rows)]
    plain = replace(problem, segments=[replace(segment, acts=None) for segment in problem.segments])
    pair = [plain.residuals(each, starts)[0][0] ** 2 * problem.weight[:, None] for each in (columns, off)]
    return pair[0], pair[1]


def _profile(problem: JointProblem, on: Array, off: Array, begins: bool) -> tuple[Array, Array]:
    """Times (n,) [s] and log likelihoods (n,) of effects that begin, or end, there; see hypotheses.log_likelihood."""
    segment = problem.segments[0]
    first, last = (off, on) if begins else (on, off)
    before = np.cumsum(first, axis=1)
    after = last.sum(axis=1, keepdims=True) - np.cumsum(last, axis=1)
    score = _likelihood(_independent(problem), np.maximum((before + after).T - white_squares(problem), 0.0))
    times = np.arange(1, on.shape[1] + 1) * segment.period_s
    inside = (times >= SETTINGS.min_onset_s) & (times <= times[-1] - SETTINGS.min_onset_s)
    return np.asarray(times[inside]), np.asarray(score[inside])


def _likelihood(counts: Array, squares: Array) -> Array:
    """Log likelihoods (...) [nats] of weighted squares (..., OUTPUTS) [-]; counts: as of `_independent`."""
    return np.asarray(-0.5 * (counts * np.log1p(squares / counts)).sum(axis=-1))


def _independent(problem: JointProblem) -> Array:
    """Numbers (OUTPUTS,) of samples of the recording that count as independent, at least one."""
    segment = problem.segments[0]
    counts = segment.use.sum(axis=1) * min(segment.period_s / problem.correlation_s, 1.0)
    return np.asarray(np.maximum(counts, 1.0), dtype=np.float64)


def _candidates(search: JointSearch, results: Sequence[StageResult]) -> list[Onset]:
    """Times at which effects may begin or end, at most one of each kind and origin."""
    problem, found = search.problem, []
    if search.own_rows:
        on, off = _both(problem, search.final, search.own_rows)
        left = np.maximum(on.sum(axis=1) - white_squares(problem), 0.0)
        always = float(_likelihood(_independent(problem), left))
        for begins in (True, False):
            times, score = _profile(problem, on, off, begins)
            if score.max() > always + SETTINGS.min_onset_gain:
                found.append((float(score.max()) - always, Onset(float(times[score.argmax()]), 0.0, begins, 0.0)))
    if search.accepted or any(result.excess_after > result.floor for result in results):
        for begins in (True, False):
            found += [each for each in (_change(problem, search.nominal, begins),) if each is not None]
    found.sort(key=lambda pair: -pair[0])
    kept: list[Onset] = []
    for _, onset in found:
        if all(abs(onset.at_s - other.at_s) > SETTINGS.min_onset_s or onset.begins != other.begins for other in kept):
            kept.append(onset)
    return kept[: SETTINGS.onset_candidates]


def _change(problem: JointProblem, nominal: MapFit, begins: bool) -> tuple[float, Onset] | None:
    """The time at which the nominal model, fitted to the sound side alone, begins or ceases to miss, and its gain."""
    segment = problem.segments[0]
    count = len(segment.angle_rad)
    times = np.asarray(np.arange(1, count + 1) * segment.period_s, dtype=np.float64)
    at = SETTINGS.sound_share * times[-1] if begins else (1.0 - SETTINGS.sound_share) * times[-1]
    best = None
    for _ in range(SETTINGS.onset_refinements):
        sound = (times <= at) == begins
        part = _with_only(problem, sound)
        fit = map_fit(part, nominal.free, np.zeros(len(nominal.z)), SETTINGS.nominal_iterations)
        squares = problem.residuals(*problem.columns(fit.free, fit.z[None]))[0][0] ** 2 * problem.weight[:, None]
        gain, at, rises = _split(squares, segment.use, white_squares(problem), times, segment.period_s)
        if gain < SETTINGS.min_onset_gain or rises != begins:
            return best
        best = gain, Onset(at, 0.0, begins, 0.0)
    return best


def _split(squares: Array, use: Flags, noise: Array, times: Array, period_s: float) -> tuple[float, float, bool]:
    """Gain in log likelihood of two scales of the noise, the time between them [s], and whether the second is larger.

    squares: (OUTPUTS, T), weighted; of the signal that gains most.  noise: (OUTPUTS,) sums of those of white noise.
    """
    inside = (times >= SETTINGS.min_onset_s) & (times <= times[-1] - SETTINGS.min_onset_s)
    best = (-np.inf, 0.0, True)
    for values, used, white in zip(squares, use, noise, strict=True):
        n = np.cumsum(used) * min(period_s / FITS.correlation_s, 1.0)
        if n[-1] <= 1.0:
            continue
        total, least = np.cumsum(values), white * n / n[-1]
        before, after = np.maximum(total - least, 0.0), np.maximum(total[-1] - total - (least[-1] - least), 0.0)
        first, second = before / np.maximum(n, 1e-9), after / np.maximum(n[-1] - n, 1e-9)
        score = -0.5 * (n * np.log1p(first) + (n[-1] - n) * np.log1p(second))
        whole = max(total[-1] - least[-1], 0.0) / n[-1]
        score = np.where(inside, score + 0.5 * n[-1] * np.log1p(whole), -np.inf)
        k = int(np.argmax(score))
        if score[k] > best[0]:
            best = float(score[k]), float(times[k]), bool(second[k] > first[k])
    return best
