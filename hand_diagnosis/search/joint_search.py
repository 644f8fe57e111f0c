"""From a joint's problem to the effects that explain it: forward, one effect at a time, then backward elimination.

First the nominal numbers move within their tolerance. Then every effect is screened, the promising ones are fitted, and
the one with the most evidence is accepted if that is enough, up to SETTINGS.max_effects. Redundant
effects are removed by backward elimination. All effects are treated alike. The last fit goes below the practical floor.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hand_diagnosis.problem import fitted_rmse, log_evidence, validation_rmse
from hand_diagnosis.search.acceptance import error_taken, is_accepted, leaves_much, too_small
from hand_diagnosis.search.completion import (
    completed,
    learned_below_floor,
    refit_below_floor,
    restarted,
    separated_below_floor,
)
from hand_diagnosis.search.found import JointSearch, NotClaimable, fit_without
from hand_diagnosis.search.hypotheses import (
    Hypothesis,
    amounts,
    fit_roughly,
    judged,
    promising,
    refined,
    with_other_fit,
)
from hand_diagnosis.search.laws import begin_law, learn_law, training_evidence, with_nominal_numbers_of
from hand_diagnosis.search.turns import with_periods
from hand_diagnosis.settings import SETTINGS
from hand_identification.driving import shape_driving
from hand_identification.free_parameters import FreeParameter
from hand_identification.joint_problem import STAGES, JointProblem
from hand_identification.map_fit import MapFit, map_fit, residual_is_correlated, with_slopes
from hand_identification.starts import fit_plain
from hand_model.arrays import Array
from hand_model.effects.effect import Effect
from hand_model.kernel.rows import ROW

SCATTER = "the scatter of the fit over its starting points"

Beginning = Callable[[JointSearch, MapFit, np.random.Generator], Hypothesis]
"""Adds a round to a search and returns the effect that it chose, around the model so far."""


def search_joint(
    problem: JointProblem,
    effects: Sequence[Effect],
    base: Sequence[FreeParameter],
    rng: np.random.Generator,
    start: Array,
    *,
    laws: bool = True,
    begin: Sequence[Beginning] = (),
) -> JointSearch:
    """Explain one joint by the effects given.

    base: free parameters of its nominal numbers.  start: (base,) coordinates [-] at which their fit begins.
    laws: whether laws are learned; without, only textbook forms are fitted, which is several times as fast.
    begin: for each cause of the whole hand, in turn, what makes it an effect of the joint (causes.with_cause).
    """
    nominal = _driven_by_own_valve(problem, fit_plain(problem, base, start, SETTINGS.nominal_iterations))
    problem = with_periods(problem, nominal, effects)
    found = JointSearch(problem, nominal, log_evidence(problem, nominal), laws=laws)
    current, evidence = _begun(found, begin, rng)
    given = {hypothesis.effect.name for hypothesis in found.accepted}
    left = [effect for effect in effects if effect.name not in given]
    for _ in range(SETTINGS.max_effects):
        best = _best_of_round(found, current, evidence, left, rng)
        best = best or _next_to_textbook(found, current, evidence, left, rng)
        if best is None:
            break
        found.accepted.append(best)
        current, evidence = best.fit, best.log_evidence
        if STAGES[best.stage] == "pressure":
            current, evidence = _driven_anew(found, current)
        left = [effect for effect in left if effect.name != best.effect.name]
    _eliminate_backward(found)
    _refit_below_floor(found, rng)
    found.rounds = [[replace(h, fit=h.fit.without_arrays()) for h in hypotheses] for hypotheses in found.rounds]
    found.accepted[:-1] = [replace(h, fit=h.fit.without_arrays()) for h in found.accepted[:-1]]
    return found


def _begun(found: JointSearch, begin: Sequence[Beginning], rng: np.random.Generator) -> tuple[MapFit, float]:
    """The model with the causes of the whole hand, and its log evidence."""
    current, evidence = found.nominal, found.nominal_evidence
    for each in begin:
        found.accepted.append(each(found, current, rng))
        current, evidence = found.final, found.accepted[-1].log_evidence
        if STAGES[found.accepted[-1].stage] == "pressure":
            current, evidence = _driven_anew(found, current)
        found.begun = current.without_arrays()
    return current, evidence


def rough_evidence(
    problem: JointProblem,
    effects: Sequence[Effect],
    base: Sequence[FreeParameter],
    rng: np.random.Generator,
    enough: Callable[[MapFit, MapFit], bool] = lambda _plain, _best: False,
) -> tuple[float, MapFit]:
    """Log evidence [nats] and fit of the best model with one effect at most; the best few of the coarse pass are fitted
    on.

    enough: whether they need not be, from the plain fit and the best one so far.
    """
    nominal = map_fit(problem, base, np.zeros(len(base)), SETTINGS.nominal_iterations)
    plain = log_evidence(problem, nominal)
    if enough(nominal, nominal):
        return plain, nominal
    fits = _ranked([fit_roughly(problem, nominal, each, rng) for each in promising(problem, nominal, effects)])
    if not fits or fits[0].log_evidence < plain:
        return plain, nominal
    if enough(nominal, fits[0].fit):
        return fits[0].log_evidence, fits[0].fit
    # Numbers that have moved to imitate an effect may keep its fit away from it: each begins at the nominal ones, too.
    moved = [parameter.row for parameter in base]
    leaders = fits[: SETTINGS.rough_leaders]
    begun = [
        replace(each, fit=replace(each.fit, z=np.where([p.row in moved for p in each.fit.free], 0.0, each.fit.z)))
        for each in leaders
    ]
    ended = [refined(problem, nominal, each, SETTINGS.passes[-1], rng) for each in (*leaders, *begun)]
    best = _ranked(ended)[0]
    return max(best.log_evidence, fits[0].log_evidence), best.fit


def _best_of_round(
    found: JointSearch, current: MapFit, evidence: float, effects: Sequence[Effect], rng: np.random.Generator
) -> Hypothesis | None:
    """The hypothesis to add to the current model of log evidence `evidence`; None ends the search.

    The first in the order of evidence that is accepted; one that is not does not stand in the way of the next.
    """
    problem = found.problem
    hypotheses = _round(problem, current, effects, rng, laws=found.laws)
    if found.laws:
        hypotheses = separated_below_floor(problem, current, _with_best_laws(problem, current, hypotheses, rng), rng)
    found.rounds.append(hypotheses)
    found.evidences.append(evidence)
    for hypothesis in hypotheses:
        if not is_accepted(problem, current, hypothesis, evidence):
            continue
        best = hypothesis
        if not best.fit.residuals:  # only the coarse passes fitted it
            best = refined(problem, current, best, SETTINGS.passes[-1], rng)
            if not is_accepted(problem, current, best, evidence):
                continue
        best, scatter = _from_other_starts(problem, current, best, rng)
        taken = max(error_taken(problem, current, best, rmse) for rmse in (validation_rmse, fitted_rmse))
        if taken >= scatter:
            return _with_textbook(problem, replace(best, fit=with_slopes(problem, best.fit)))
        found.not_claimable.append(NotClaimable(best.effect, best.stage, taken, scatter, SCATTER))
    found.not_claimable += too_small(problem, current, hypotheses)
    return None


def _next_to_textbook(
    found: JointSearch, current: MapFit, evidence: float, effects: Sequence[Effect], rng: np.random.Generator
) -> Hypothesis | None:
    """The effect to add where nothing helps next to the last law: in addition to its textbook form, it explains more.

    A learned law may take over a second effect in part, as drag at low speeds does friction; no other one then helps,
    although much is left. If two textbook forms have clearly more evidence, the last effect gets its own back.
    """
    last = found.accepted[-1] if found.accepted else None
    if last is None or last.given or last.textbook is None or not leaves_much(found.problem, current, current):
        return None
    textbook = last.textbook
    plain = map_fit(found.problem, textbook.free, textbook.z, SETTINGS.nominal_iterations)
    kept, small = len(found.rounds), list(found.not_claimable)
    best = _best_of_round(found, plain, log_evidence(found.problem, plain, amounts(plain)), effects, rng)
    surpasses = best is not None and best.log_evidence >= evidence + SETTINGS.min_log_evidence
    gone = kept - 1 if surpasses else kept  # the round that found nothing, or this one
    del found.rounds[gone], found.evidences[gone]
    if best is None or not surpasses:
        found.not_claimable = small
        return None
    found.accepted[-1] = replace(last, fit=plain, freed=(), textbook=None)
    return best


def _with_textbook(problem: JointProblem, best: Hypothesis) -> Hypothesis:
    """The hypothesis with a fit of its textbook form, which one that began with its law has not."""
    if not best.freed or best.textbook is not None:
        return best
    rows = {ROW[key] for key in best.freed}
    kept = np.array([parameter.row not in rows for parameter in best.fit.free])
    free = [parameter for parameter, keep in zip(best.fit.free, kept, strict=True) if keep]
    textbook = map_fit(problem, free, best.fit.z[kept], SETTINGS.nominal_iterations)
    return replace(best, textbook=textbook.without_arrays())


def _driven_anew(found: JointSearch, current: MapFit) -> tuple[MapFit, float]:
    """The current model and its evidence after the joint's driving pressure is shaped by the improved valve model."""
    problem = found.problem
    current = _driven_by_own_valve(problem, current)
    found.nominal = map_fit(problem, found.nominal.free, found.nominal.z, SETTINGS.nominal_iterations)
    found.accepted[-1] = replace(found.accepted[-1], fit=current)
    return current, log_evidence(problem, current, amounts(current))


def _driven_by_own_valve(problem: JointProblem, fit: MapFit) -> MapFit:
    """The fit continued after its model of the valve shapes the joint's driving pressure."""
    shape_driving(problem, fit.free, fit.z)
    return map_fit(problem, fit.free, fit.z, SETTINGS.nominal_iterations)


def _round(
    problem: JointProblem, current: MapFit, effects: Sequence[Effect], rng: np.random.Generator, *, laws: bool
) -> list[Hypothesis]:
    chosen = promising(problem, current, effects, laws=laws and leaves_much(problem, current, current))
    ranked = _ranked([fit_roughly(problem, current, screened, rng) for screened in chosen])
    for fit_pass in SETTINGS.passes[1:]:
        ranked = [replace(hypothesis, fit=hypothesis.fit.without_arrays()) for hypothesis in ranked]
        near = ranked[: fit_pass.most]
        if fit_pass is SETTINGS.passes[-1]:
            near = [h for h in near if h.log_evidence > ranked[0].log_evidence - SETTINGS.max_evidence_gap]
        elif near and leaves_much(problem, current, near[0].fit):
            near = [restarted(problem, current, hypothesis, fit_pass, rng) for hypothesis in near]
        further = [_without_slopes(refined(problem, current, each, fit_pass, rng)) for each in near]
        ranked = _ranked(further + ranked[len(near) :])
    return ranked


def _without_slopes(hypothesis: Hypothesis) -> Hypothesis:
    """A hypothesis that may not be chosen keeps no slopes: those of a dozen take much memory."""
    return replace(hypothesis, fit=hypothesis.fit.without_slopes())


def _with_best_laws(
    problem: JointProblem, current: MapFit, hypotheses: Sequence[Hypothesis], rng: np.random.Generator
) -> list[Hypothesis]:
    """The hypotheses of a round ranked again, the leaders by the better one of their laws.

    A class wins or loses by its best law, not by its textbook form. Laws are freed only where the first hypothesis
    leaves clearly more than the noise. Every rival whose coarse fit is near the best one is fitted to the end, so that
    learned laws are compared with learned laws.
    """
    if not hypotheses:
        return []
    freed = [k for k, h in enumerate(hypotheses) if h.effect.coefficients][: SETTINGS.law_leaders]
    if leaves_much(problem, current, hypotheses[0].fit):
        return _with_laws_of(problem, current, hypotheses, freed, rng)
    # A textbook form fits; a rival that explains most of it may do so with its law; the leader then gets its own, too.
    enough = current.cost - SETTINGS.rival_share * (current.cost - hypotheses[0].fit.cost)
    rivals = [k for k in freed if k > 0 and hypotheses[k].fit.cost < enough]
    ranked = _with_laws_of(problem, current, hypotheses, rivals, rng)
    surpassed = [k for k, each in enumerate(ranked) if each is hypotheses[0] and k > 0 and 0 in freed]
    return _with_laws_of(problem, current, ranked, surpassed, rng)


def _with_laws_of(
    problem: JointProblem,
    current: MapFit,
    hypotheses: Sequence[Hypothesis],
    freed: Sequence[int],
    rng: np.random.Generator,
) -> list[Hypothesis]:
    """The hypotheses ranked again after the laws of those at the given places were freed."""
    coarse = replace(problem, step_s=SETTINGS.passes[0].step_s)
    begun = {k: begin_law(coarse, hypotheses[k].fit, hypotheses[k].effect, rng) for k in freed}
    if not begun:
        return list(hypotheses)
    first = min(begun, key=lambda k: begun[k][0].cost)
    for number in begun.keys() - {first}:
        begun[number].insert(0, with_nominal_numbers_of(coarse, begun[number][0], begun[first][0]))
    evidence = {number: training_evidence(coarse, fits[0]) for number, fits in begun.items()}
    ranked, limit = list(hypotheses), max(evidence.values()) - SETTINGS.max_evidence_gap
    for number in [k for k in begun if evidence[k] > limit]:
        ranked[number] = _with_best_law(problem, current, hypotheses[number], begun[number], rng)
    return _ranked(ranked)


def _with_best_law(
    problem: JointProblem, current: MapFit, hypothesis: Hypothesis, begun: Sequence[MapFit], rng: np.random.Generator
) -> Hypothesis:
    """The hypothesis with its learned law where that is preferred, and otherwise as it is."""
    coarse = replace(problem, step_s=SETTINGS.passes[0].step_s)
    law = learn_law(coarse, hypothesis.fit, hypothesis.effect, rng, begun)
    if not law.preferred:
        return hypothesis
    fit = map_fit(problem, law.fit.free, law.fit.z, SETTINGS.restart_iterations)
    learned = judged(problem, current, hypothesis.effect, fit, rng)
    if learned.log_evidence < hypothesis.log_evidence:
        return hypothesis
    return replace(learned, freed=(*hypothesis.freed, *law.freed), textbook=hypothesis.fit.without_arrays())


def _ranked(hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    return sorted(hypotheses, key=lambda hypothesis: -hypothesis.log_evidence)


def _from_other_starts(
    problem: JointProblem, current: MapFit, best: Hypothesis, rng: np.random.Generator
) -> tuple[Hypothesis, float]:
    """The best of several starts, and the range of the validation errors [SI] of those that fit equally well."""
    fits = [best.fit]
    for _ in range(SETTINGS.further_starts):
        start = best.fit.z + SETTINGS.start_jitter * rng.standard_normal(len(best.fit.z))
        fits.append(map_fit(problem, best.fit.free, start, SETTINGS.restart_iterations))
    fits.sort(key=lambda fit: fit.cost)
    alike = [fit for fit in fits if fit.cost < fits[0].cost + SETTINGS.min_log_evidence]
    errors = [validation_rmse(problem, fit.squares)[best.stage] for fit in alike]
    chosen = best
    if fits[0] is not best.fit:
        chosen = with_other_fit(problem, current, best, fits[0], rng)
    return chosen, float(np.ptp(errors))


def _eliminate_backward(found: JointSearch) -> None:
    """Remove redundant effects, the least needed first; a cause of the whole hand stays."""
    while len(found.accepted) > 1:
        own = [index for index, each in enumerate(found.accepted[:-1]) if not each.given]
        trials = {index: fit_without(found, index) for index in own}
        if not trials:
            return
        index = max(trials, key=lambda k: trials[k][0])
        evidence, fit = trials[index]
        if evidence < found.accepted[-1].log_evidence - SETTINGS.min_log_evidence / 2.0:
            return
        kept = [hypothesis for k, hypothesis in enumerate(found.accepted) if k != index]
        kept[-1] = replace(kept[-1], fit=fit, log_evidence=evidence)
        found.accepted = kept


def _refit_below_floor(found: JointSearch, rng: np.random.Generator) -> None:
    """Fit the first and the last model below the practical floor; numbers that are loose there mispredict other data.

    The laws of the effects found are freed where more than white noise is left.
    """
    found.forget_sensitivities()
    if found.accepted:
        last = found.accepted[-1]
        left = residual_is_correlated(found.problem, last.fit, SETTINGS.min_correlated_ratio)
        found.accepted[-1] = replace(last, fit=refit_below_floor(found.problem, last.fit))
        if found.laws and left:
            found.accepted = learned_below_floor(found.problem, found.accepted, rng)
            found.accepted = completed(found.problem, found.accepted, rng)
        if any(STAGES[hypothesis.stage] == "pressure" for hypothesis in found.accepted):
            # The last fits may have changed the valve, by whose model the joint is driven.
            shape_driving(found.problem, found.final.free, found.final.z)
            last = found.accepted[-1]
            found.accepted[-1] = replace(last, fit=refit_below_floor(found.problem, last.fit))
    found.nominal = refit_below_floor(found.problem, found.nominal)
