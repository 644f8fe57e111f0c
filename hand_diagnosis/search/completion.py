"""Further fits where more than noise is left: from other starts, below the practical floor, of all laws at once.

A search frees a law class by class and stops as soon as the cost hardly falls, which is enough to separate classes.
What is then left on data that were not fitted may be a minimum that is not the best one. The training data fit, the
validation data choose among the fits, and one is taken only where these data confirm it.

The last fits are those to data that chose before. Of a hand, the models that are tested and reported are fitted to the
validation data, too. Of a machine, the numbers that its user takes home are fitted to all that was recorded: when the
test error has been measured, nothing is chosen against these data any more, and a law over the pressure needs every
pressure that was recorded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hand_diagnosis.problem import (
    block_bootstrap,
    likelihood_below_floor,
    log_evidence,
    validation_rmse,
    weighted_by_noise,
    weighted_by_rest,
    white_parts,
)
from hand_diagnosis.search.hypotheses import Hypothesis, amounts, with_other_fit
from hand_diagnosis.search.laws import learn_law, posterior_covariance, thinned
from hand_diagnosis.settings import SETTINGS, FitPass
from hand_identification.common_scale import at_prior_scale
from hand_identification.free_parameters import FreeParameter, law_free_parameters, speed_free_parameters
from hand_identification.idle_numbers import idle_at_prior
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, map_fit, residual_is_correlated
from hand_identification.robust_errors import robust_errors
from hand_identification.starts import Elsewhere, around
from hand_model.arrays import Array
from hand_model.kernel.rows import ROW

ELSEWHERE = Elsewhere(SETTINGS.restart_points, SETTINGS.restart_fits, SETTINGS.restart_reach, SETTINGS.restart_change)
"""Where a fit that leaves more than noise starts again."""


def restarted(
    problem: JointProblem, current: MapFit, rough: Hypothesis, fit_pass: FitPass, rng: np.random.Generator
) -> Hypothesis:
    """A hypothesis by the best fit from the cheapest points elsewhere in its own numbers, or as it is."""
    stepped = replace(problem, step_s=fit_pass.step_s)
    rows = {ROW[key] for key in (*rough.effect.keys, *rough.freed)}
    fits = [
        map_fit(stepped, rough.fit.free, start, fit_pass.iterations, fit_pass.tolerance).without_arrays()
        for start in around(stepped, rough.fit, rows, ELSEWHERE, rng)
    ]
    best = min(fits, key=lambda fit: fit.cost, default=rough.fit)
    if best.cost >= rough.fit.cost:
        return rough
    return with_other_fit(problem, current, rough, best, rng)


def learned_below_floor(
    problem: JointProblem, accepted: Sequence[Hypothesis], rng: np.random.Generator
) -> list[Hypothesis]:
    """The effects found with free laws, where the validation data confirm what these explain below the floor.

    A law that is free in part gets its other coefficients.

    accepted: in the order in which they were found; the last one holds the fit of all.
    """
    done = list(accepted)
    for k, hypothesis in enumerate(done):
        final = done[-1].fit
        correlated = residual_is_correlated(problem, final, SETTINGS.min_correlated_ratio)
        learned = set(hypothesis.effect.coefficients) <= {parameter.key for parameter in final.free}
        if learned or not correlated or hypothesis.given:
            continue
        sharp = weighted_by_noise(problem, final)
        # Evidence and covariance of both laws must come from the same weights.
        textbook = map_fit(sharp, final.free, final.z, SETTINGS.refit_iterations).without_slopes()
        law = learn_law(sharp, textbook, hypothesis.effect, rng)
        if law.preferred:
            plain = hypothesis.textbook or final.without_arrays()
            done[k] = replace(done[k], freed=(*hypothesis.freed, *law.freed), textbook=plain)
            done[-1] = replace(done[-1], fit=at_floor(problem, law.fit))
    return done


def separated_below_floor(
    problem: JointProblem, current: MapFit, hypotheses: Sequence[Hypothesis], rng: np.random.Generator
) -> list[Hypothesis]:
    """The hypotheses of a round, those close behind the first one separated by what they leave below it.

    hypotheses: the most evident first.  The practical floor says what may be claimed; which of several names for one
    claim is right shows below it as well. Each leader is fitted with the weights of the noise, its law free. The log
    evidence of one falls by the log likelihood that its validation data lack against the best leader's.
    """
    leaders = [h for h in hypotheses if h.log_evidence > hypotheses[0].log_evidence - SETTINGS.near_log_evidence]
    if len(leaders) < 2:
        return list(hypotheses)
    fits = [at_floor(problem, hypothesis.fit) for hypothesis in leaders]
    if not residual_is_correlated(problem, fits[0], SETTINGS.min_correlated_ratio):
        return list(hypotheses)
    scores = [_score_below_floor(problem, current, h, fit, rng) for h, fit in zip(leaders, fits, strict=True)]
    best = max(scores)
    changed = [
        replace(hypothesis, log_evidence=hypothesis.log_evidence - (best - score))
        for hypothesis, score in zip(leaders, scores, strict=True)
    ]
    return sorted(changed + list(hypotheses[len(leaders) :]), key=lambda hypothesis: -hypothesis.log_evidence)


def _score_below_floor(
    problem: JointProblem, current: MapFit, hypothesis: Hypothesis, begun: MapFit, rng: np.random.Generator
) -> float:
    """Log likelihood of the validation data against the white noise, of the better one of both forms of a law.

    begun: the fit of the hypothesis at the practical floor.
    """
    sharp = weighted_by_noise(problem, begun)
    fit = map_fit(sharp, begun.free, begun.z, SETTINGS.refit_iterations)
    if hypothesis.effect.coefficients and not hypothesis.freed:
        law = learn_law(sharp, fit, hypothesis.effect, rng)
        fit = law.chosen
    return likelihood_below_floor(problem, current, fit)


def with_known_numbers(problem: JointProblem, nominal: MapFit, accepted: Sequence[Hypothesis]) -> list[Hypothesis]:
    """The effects found, those with a law around the numbers of the plain plant as these are known, if that suffices.

    Many a textbook form is other numbers of the plain plant, free far beyond their tolerance. Next to a law they need
    not be, and what the data leave open of them mispredicts other data. They stay free where leaving them so has the
    log evidence that an effect needs. nominal: the plain model.
    """
    fit, known = accepted[-1].fit, {parameter.row: parameter for parameter in nominal.free}
    lawful = [hypothesis for hypothesis in accepted if hypothesis.freed and not hypothesis.given]
    rows = {ROW[key] for hypothesis in lawful for key in hypothesis.effect.keys} & known.keys()
    if not rows:
        return list(accepted)
    have = {p.row for p in fit.free}
    added = [p for h in lawful for p in law_free_parameters(h.effect, problem.nominal) if p.row not in have]
    free = [*(known[p.row] if p.row in rows else p for p in fit.free), *added]
    new = np.isin([p.row for p in free], [p.row for p in added])
    here = fit.in_terms_of(free)
    starts = [here, np.where(new, SETTINGS.law_start_of_all, here)]
    fits = [map_fit(problem, free, start, SETTINGS.law_iterations[1]) for start in starts]
    laws = {ROW[key] for hypothesis in lawful for key in hypothesis.effect.coefficients}
    tight = thinned(problem, min(fits, key=lambda each: each.cost), laws)
    before, after = (log_evidence(problem, each, amounts(each)) for each in (fit, tight))
    if after < before - SETTINGS.min_log_evidence:
        return list(accepted)
    return _with_fit(problem, accepted, tight)


def refit_below_floor(problem: JointProblem, fit: MapFit) -> MapFit:
    """The fit continued with the weights of the noise; cost and covariance stay those of the practical floor.

    Which effects are missing is decided against the floor. Once that is decided, there is no reason to leave, for the
    sake of priors, what the same numbers explain.
    """
    sharp = weighted_by_noise(problem, fit)
    refit = map_fit(sharp, fit.free, fit.z, SETTINGS.refit_iterations).without_slopes()
    return at_floor(problem, idle_at_prior(sharp, at_prior_scale(sharp, refit)))


def with_validation(
    problem: JointProblem, nominal: MapFit, accepted: Sequence[Hypothesis]
) -> tuple[MapFit, list[Hypothesis]]:
    """The nominal model and the effects found, fitted below the floor to training and validation data together.

    For the time when nothing is chosen any more.
    """
    everything = replace(problem, holds_out=False)
    last = replace(accepted[-1], fit=refit_below_floor(everything, accepted[-1].fit))
    return refit_below_floor(everything, nominal), [*accepted[:-1], last]


def at_floor(problem: JointProblem, done: MapFit) -> MapFit:
    """A fit with the larger weights, with the cost and the covariance of the practical floor."""
    return map_fit(problem, done.free, done.z, 1)


def completed(problem: JointProblem, accepted: Sequence[Hypothesis], rng: np.random.Generator) -> list[Hypothesis]:
    """The effects found with the best fit of all their laws, or as they are where no other fit is confirmed.

    accepted: in the order in which they were found; the last one holds the fit of all.
    """
    fit = accepted[-1].fit
    have = {p.row for p in fit.free}
    ours = [hypothesis for hypothesis in accepted if not hypothesis.given]
    added = [
        p for hypothesis in ours for p in law_free_parameters(hypothesis.effect, problem.nominal) if p.row not in have
    ]
    own = {key for h in ours for key in (*h.keys, *h.effect.coefficients)}
    stage = _stage_left(problem, fit)
    if stage is None or not any(h.effect.coefficients for h in ours):
        return list(accepted)
    sharp = weighted_by_noise(problem, fit)
    free = [*fit.free, *added]
    fits = [_fitted(sharp, free, start) for start in _starts(fit, free, own, rng)]
    best = min(fits, key=lambda each: _validation_score(problem, each))
    laws = {ROW[key] for h in ours for key in h.effect.coefficients if key not in h.effect.keys}
    fewer = thinned(sharp, best, laws)
    scores = [_validation_score(problem, each) for each in (best, fewer)]
    if scores[1] <= (1.0 + SETTINGS.min_relative_improvement) * scores[0]:
        best = fewer
    if not _confirmed(problem, fit, best, stage):
        return list(accepted)
    return _with_fit(problem, accepted, best)


def _fitted(problem: JointProblem, free: Sequence[FreeParameter], start: Array) -> MapFit:
    """A fit with ever smaller finite differences."""
    for difference in SETTINGS.completion_differences:
        fit = map_fit(
            problem,
            free,
            start,
            SETTINGS.completion_iterations,
            SETTINGS.completion_tolerance,
            difference=difference,
        )
        start = fit.z
    return fit


def _stage_left(problem: JointProblem, fit: MapFit) -> int | None:
    """The signal whose validation error exceeds its white noise most, in repeatability floors; None where none does."""
    rmse = validation_rmse(problem, fit.squares)
    left = np.nan_to_num((rmse**2 - white_parts(problem, fit) ** 2) / problem.floor**2)
    worst = int(np.argmax(left))
    return worst if left[worst] > SETTINGS.completion_min_excess**2 else None


def _starts(fit: MapFit, free: Sequence[FreeParameter], own: set[str], rng: np.random.Generator) -> list[Array]:
    """Points (free,): the fit itself, and ones around a part of it; half of them with the nominal numbers released."""
    here = np.concatenate([fit.z, np.zeros(len(free) - len(fit.z))])
    ours = np.array([p.key in own for p in free])
    starts = [here]
    for k in range(SETTINGS.completion_starts):
        size = SETTINGS.completion_jitter[k % len(SETTINGS.completion_jitter)]
        moved = here * rng.uniform(0.0, 1.0) + size * rng.standard_normal(len(here))
        starts.append(np.where(ours, moved, here if k % 2 else 0.0))
    return starts


def _validation_score(problem: JointProblem, fit: MapFit) -> float:
    """Sum over the signals of the validation mean squares, in squared repeatability floors."""
    return float(np.nansum(validation_rmse(problem, fit.squares) ** 2 / problem.floor**2))


def _confirmed(problem: JointProblem, before: MapFit, after: MapFit, stage: int) -> bool:
    """Whether a fit reduces the validation error of a signal significantly, and makes none larger.

    Evidence does not decide: below the repeatability it favours the fewest coefficients, whatever they explain.
    """
    old, new = (validation_rmse(problem, fit.squares) for fit in (before, after))
    with np.errstate(invalid="ignore"):
        if np.any(
            new
            > (1.0 + SETTINGS.min_relative_improvement) * np.hypot(old, SETTINGS.completion_unnoticed * problem.floor)
        ):
            return False
    rng = np.random.default_rng(SETTINGS.noise_seed)
    fall = block_bootstrap(problem, before.squares, after.squares, stage, rng)
    return bool(fall[0] > 0.0 and new[stage] < (1.0 - SETTINGS.min_relative_improvement) * old[stage])


def _with_fit(problem: JointProblem, accepted: Sequence[Hypothesis], fit: MapFit) -> list[Hypothesis]:
    """The effects with another fit of all; each keeps the fit of its textbook form."""
    have = {p.key for p in fit.free}
    done = []
    for hypothesis in accepted:
        if hypothesis.given:
            done.append(hypothesis)
            continue
        freed = tuple(
            key for key in hypothesis.effect.coefficients if key in have and key not in hypothesis.effect.keys
        )
        textbook = hypothesis.textbook or accepted[-1].fit.without_arrays()
        done.append(replace(hypothesis, freed=freed, textbook=textbook if freed else hypothesis.textbook))
    done[-1] = replace(done[-1], fit=map_fit(problem, fit.free, fit.z, 1))
    return done


def on_everything(
    whole: JointProblem, nominal: MapFit, accepted: Sequence[Hypothesis], rng: np.random.Generator, *, laws: bool
) -> tuple[JointProblem, MapFit, list[Hypothesis]]:
    """The nominal model and the effects found, fitted to all data of a problem, and the problem of these fits.

    laws: whether the laws of the effects are completed first, where validation blocks of all recordings confirm it.
    """
    plain = map_fit(whole, *_with_all_speeds(whole, nominal), SETTINGS.nominal_iterations)
    done = list(accepted)
    if done:
        last = map_fit(whole, *_with_all_speeds(whole, done[-1].fit), SETTINGS.nominal_iterations)
        done[-1] = replace(done[-1], fit=last)
        done = completed(whole, done, rng) if laws else done
    everything = replace(weighted_by_noise(whole, done[-1].fit if done else plain), holds_out=False)
    plain = _ended(everything, plain)
    final = _ended(everything, done[-1].fit) if done else plain
    settled = weighted_by_rest(everything, final)
    if done:
        done[-1] = replace(done[-1], fit=at_prior_scale(settled, _ended(settled, final)))
    return settled, _ended(settled, plain), done


def _with_all_speeds(whole: JointProblem, fit: MapFit) -> tuple[list[FreeParameter], Array]:
    """The free parameters of a fit and the first speeds of recordings that it did not see, and where to start."""
    have = {parameter.row for parameter in fit.free}
    speeds = [] if whole.driven else speed_free_parameters(whole.starts(1)[0, 1:].tolist())
    more = [parameter for parameter in speeds if parameter.row not in have]
    return [*fit.free, *more], np.concatenate([fit.z, np.zeros(len(more))])


def _ended(problem: JointProblem, fit: MapFit) -> MapFit:
    return map_fit(problem, fit.free, fit.z, SETTINGS.completion_iterations, SETTINGS.completion_tolerance)


def standard_errors(problem: JointProblem, fit: MapFit) -> Array:
    """Standard errors (free,) [-] of the coordinates of a fit.

    Those of its covariance; of a fit to everything, the larger ones of its error and of what does not fit.
    """
    if problem.holds_out:
        return np.asarray(np.sqrt(np.diag(fit.covariance)))
    own = np.sqrt(np.diag(posterior_covariance(problem, fit)))
    return np.maximum(own, robust_errors(problem, fit))
