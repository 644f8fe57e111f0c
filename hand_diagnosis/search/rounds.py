"""A round of the search: effects screened next to the current model, the leaders fitted, laws freed, one accepted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hand_diagnosis.problem import fitted_rmse, validation_rmse
from hand_diagnosis.search.acceptance import error_taken, is_accepted, leaves_much, too_small
from hand_diagnosis.search.completion import restarted, separated_below_floor
from hand_diagnosis.search.found import JointSearch, NotClaimable
from hand_diagnosis.search.hypotheses import Hypothesis, fit_roughly, judged, promising, refined, with_other_fit
from hand_diagnosis.search.laws import begin_law, learn_law, training_evidence, with_nominal_numbers_of
from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, map_fit, with_slopes
from hand_model.effects.effect import Effect
from hand_model.kernel.rows import ROW

SCATTER = "the scatter of the fit over its starting points"


def best_of_round(
    found: JointSearch, current: MapFit, evidence: float, effects: Sequence[Effect], rng: np.random.Generator
) -> Hypothesis | None:
    """The hypothesis to add to the current model of log evidence `evidence` [nats]; None ends the search.

    The first in the order of evidence that is accepted; one that is not does not stand in the way of the next.
    """
    problem = found.problem
    hypotheses = ranked_round(found, current, effects, rng)
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
            return with_textbook(problem, replace(best, fit=with_slopes(problem, best.fit)))
        found.not_claimable.append(NotClaimable(best.effect, best.stage, taken, scatter, SCATTER))
    found.not_claimable += too_small(problem, current, hypotheses)
    return None


def with_textbook(problem: JointProblem, best: Hypothesis) -> Hypothesis:
    """The hypothesis with a fit of its textbook form, which one that began with its law has not."""
    if not best.freed or best.textbook is not None:
        return best
    rows = {ROW[key] for key in best.freed}
    kept = np.array([parameter.row not in rows for parameter in best.fit.free])
    free = [parameter for parameter, keep in zip(best.fit.free, kept, strict=True) if keep]
    textbook = map_fit(problem, free, best.fit.z[kept], SETTINGS.nominal_iterations)
    return replace(best, textbook=textbook.without_arrays())


def ranked_round(
    found: JointSearch,
    current: MapFit,
    effects: Sequence[Effect],
    rng: np.random.Generator,
    known: Sequence[Hypothesis] = (),
) -> list[Hypothesis]:
    """Hypotheses of one more effect next to the current model, the most evident first, laws freed where they may be.

    known: further hypotheses, which are fitted already.
    """
    problem = found.problem
    hypotheses = _round(problem, current, effects, rng, laws=found.laws)
    if not found.laws:
        return by_evidence([*known, *hypotheses])
    learned = by_evidence([*known, *_with_best_laws(problem, current, hypotheses, rng)])
    return separated_below_floor(problem, current, learned, rng) if learned else []


def _round(
    problem: JointProblem, current: MapFit, effects: Sequence[Effect], rng: np.random.Generator, *, laws: bool
) -> list[Hypothesis]:
    chosen = promising(problem, current, effects, laws=laws and leaves_much(problem, current, current))
    ranked = by_evidence([fit_roughly(problem, current, screened, rng) for screened in chosen])
    for fit_pass in SETTINGS.passes[1:]:
        ranked = [replace(hypothesis, fit=hypothesis.fit.without_arrays()) for hypothesis in ranked]
        near = ranked[: fit_pass.most]
        if fit_pass is SETTINGS.passes[-1]:
            near = [h for h in near if h.log_evidence > ranked[0].log_evidence - SETTINGS.max_evidence_gap]
        elif near and leaves_much(problem, current, near[0].fit):
            near = [restarted(problem, current, hypothesis, fit_pass, rng) for hypothesis in near]
        further = [without_slopes(refined(problem, current, each, fit_pass, rng)) for each in near]
        ranked = by_evidence(further + ranked[len(near) :])
    return ranked


def without_slopes(hypothesis: Hypothesis) -> Hypothesis:
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
    return by_evidence(ranked)


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


def by_evidence(hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Hypotheses, the most evident first."""
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
