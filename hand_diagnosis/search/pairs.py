"""Effects that are missing together: two that only both explain, and each one weighed again next to the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hand_diagnosis.search.acceptance import is_accepted, leaves_much
from hand_diagnosis.search.found import JointSearch, fit_without
from hand_diagnosis.search.hypotheses import Hypothesis, judged, refined, with_other_fit
from hand_diagnosis.search.rounds import best_of_round, ranked_round, with_textbook, without_slopes
from hand_diagnosis.settings import SETTINGS
from hand_identification.map_fit import MapFit, with_slopes
from hand_model.effects.effect import Effect


def two_at_once(
    found: JointSearch, current: MapFit, evidence: float, effects: Sequence[Effect], rng: np.random.Generator
) -> list[Hypothesis]:
    """Two effects that explain what neither does alone; none where little is left, or no pair is accepted.

    While one is missing, the error that the other takes away falls in some blocks only, and is no reason to accept it.
    Each leader of the last round is tried with the best effect next to it. The pair has clearly more evidence than any
    effect alone. evidence: log evidence of the current model [nats].
    """
    problem = found.problem
    if len(found.accepted) > SETTINGS.max_effects - 2 or not leaves_much(problem, current, current):
        return []
    least = evidence + SETTINGS.min_log_evidence
    leaders = [each for each in found.rounds[-1] if each.log_evidence >= least][: SETTINGS.pair_leaders]
    tried: list[tuple[Hypothesis, Hypothesis, JointSearch]] = []
    for leader in leaders:
        first = refined(problem, current, leader, SETTINGS.passes[-1], rng)
        slopes = with_slopes(problem, first.fit)
        others = [effect for effect in effects if effect.name != first.effect.name]
        beside = replace(found, rounds=[], evidences=[], not_claimable=[])
        second = best_of_round(beside, slopes, first.log_evidence, others, rng)
        if second is None or second.log_evidence < leaders[0].log_evidence + SETTINGS.min_log_evidence:
            continue
        both = judged(problem, current, second.effect, second.fit, rng)
        if is_accepted(problem, current, both, evidence):
            tried.append((without_slopes(first), second, beside))
    if not tried:
        return []
    first, second, beside = max(tried, key=lambda each: each[1].log_evidence)
    found.rounds += beside.rounds
    found.evidences += beside.evidences
    return [first, second]


def weighed_again(found: JointSearch, effects: Sequence[Effect], rng: np.random.Generator) -> None:
    """Every effect but the last is compared with its rivals again, next to all others that were found later.

    While the others were missing, what they leave hid how well each rival fits. Where one has more evidence than the
    effect now, it takes its place. The round in which the effect was accepted becomes the new one.
    """
    for name in [hypothesis.effect.name for hypothesis in found.accepted[:-1] if not hypothesis.given]:
        index = next(k for k, each in enumerate(found.accepted) if each.effect.name == name)
        place = found.round_of(name)
        evidence, without = fit_without(found, index)
        without = with_slopes(found.problem, without)
        accepted = found.accepted[index]
        named = {each.effect.name for each in found.rounds[place]} - {each.effect.name for each in found.accepted}
        rivals = [effect for effect in effects if effect.name in named]
        own = with_other_fit(found.problem, without, accepted, found.final, rng)
        hypotheses = ranked_round(found, without, rivals, rng, [own])
        best, own = hypotheses[0], next(each for each in hypotheses if each.effect.name == name)
        if best.log_evidence >= own.log_evidence + SETTINGS.min_log_evidence / 2.0:
            best = best if best.fit.residuals else refined(found.problem, without, best, SETTINGS.passes[-1], rng)
            if is_accepted(found.problem, without, best, evidence):
                best = with_textbook(found.problem, replace(best, fit=with_slopes(found.problem, best.fit)))
                found.accepted = [*(each for k, each in enumerate(found.accepted) if k != index), best]
                own = best
        if own.log_evidence > evidence:  # one that is not needed is removed later, unless another one is
            found.rounds[place], found.evidences[place] = hypotheses, evidence
