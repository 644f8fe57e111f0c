"""From a joint's problem to the effects that explain it: forward, one effect at a time, then backward elimination.

First the nominal numbers move within their tolerance. Then every effect is screened, the promising ones are fitted, and
the one with the most evidence is accepted if that is enough, up to SETTINGS.max_effects; where none is, two are tried
at once. Each is weighed again next to the others, and redundant effects are removed by backward elimination. All are
treated alike. The last fit goes below the practical floor.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hand_diagnosis.problem import log_evidence
from hand_diagnosis.search.acceptance import leaves_much
from hand_diagnosis.search.completion import (
    completed,
    learned_below_floor,
    refit_below_floor,
    with_known_numbers,
)
from hand_diagnosis.search.found import JointSearch, fit_without
from hand_diagnosis.search.hypotheses import (
    Hypothesis,
    amounts,
    fit_roughly,
    promising,
    refined,
)
from hand_diagnosis.search.pairs import two_at_once, weighed_again
from hand_diagnosis.search.rounds import best_of_round, by_evidence
from hand_diagnosis.search.turns import with_periods
from hand_diagnosis.settings import SETTINGS
from hand_identification.driving import shape_driving
from hand_identification.free_parameters import FreeParameter
from hand_identification.joint_problem import STAGES, JointProblem
from hand_identification.map_fit import MapFit, map_fit, residual_is_correlated
from hand_identification.starts import fit_plain
from hand_model.arrays import Array
from hand_model.effects.effect import Effect

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
        added = _next_effects(found, current, evidence, left, rng)
        if not added:
            break
        found.accepted += added
        current, evidence = added[-1].fit, added[-1].log_evidence
        if any(STAGES[each.stage] == "pressure" for each in added):
            current, evidence = _driven_anew(found, current)
        names = {each.effect.name for each in added}
        left = [effect for effect in left if effect.name not in names]
    weighed_again(found, effects, rng)
    _eliminate_backward(found)
    _refit_below_floor(found, rng)
    found.rounds = [[replace(h, fit=h.fit.without_arrays()) for h in hypotheses] for hypotheses in found.rounds]
    found.accepted[:-1] = [replace(h, fit=h.fit.without_arrays()) for h in found.accepted[:-1]]
    return found


def _next_effects(
    found: JointSearch, current: MapFit, evidence: float, effects: Sequence[Effect], rng: np.random.Generator
) -> list[Hypothesis]:
    """One effect to add to the current model of log evidence `evidence`, or two at once; none ends the search."""
    best = best_of_round(found, current, evidence, effects, rng)
    best = best or _next_to_textbook(found, current, evidence, effects, rng)
    return [best] if best is not None else two_at_once(found, current, evidence, effects, rng)


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
    fits = by_evidence([fit_roughly(problem, nominal, each, rng) for each in promising(problem, nominal, effects)])
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
    best = by_evidence(ended)[0]
    return max(best.log_evidence, fits[0].log_evidence), best.fit


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
    best = best_of_round(found, plain, log_evidence(found.problem, plain, amounts(plain)), effects, rng)
    surpasses = best is not None and best.log_evidence >= evidence + SETTINGS.min_log_evidence
    gone = kept - 1 if surpasses else kept  # the round that found nothing, or this one
    del found.rounds[gone], found.evidences[gone]
    if best is None or not surpasses:
        found.not_claimable = small
        return None
    found.accepted[-1] = replace(last, fit=plain, freed=(), textbook=None)
    return best


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
        found.accepted = with_known_numbers(found.problem, found.nominal, found.accepted)
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
