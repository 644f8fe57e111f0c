"""Causes of the whole hand: one set of numbers for all joints, compared with what was found joint by joint.

An effect says which of its parameters are those of the hand (Effect.shared): all of a supply or of two clocks, the
attitude of the hand of a weight. These are fitted to all joints at once. Whether a joint needs other effects as well is
decided with the cause in place. The cause counts where its log evidence exceeds the sum of what was found on
each joint alone, and where at least two joints show it: one number for all costs one factor of Occam and not one
per joint.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hand_diagnosis.problem import log_evidence, shared_log_evidence
from hand_diagnosis.search.found import JointSearch
from hand_diagnosis.search.hypotheses import Hypothesis, amounts, judged, promised_shares
from hand_diagnosis.settings import SETTINGS
from hand_identification.free_parameters import (
    FreeParameter,
    effect_free_parameters,
    fixed,
    law_free_parameters,
    merged,
    probe_values,
)
from hand_identification.map_fit import MapFit, map_fit, start_at
from hand_identification.posterior import posterior_of
from hand_identification.shared_fit import Part, SharedFit, shared_fit
from hand_model.arrays import Array
from hand_model.effects.effect import Effect
from hand_model.kernel.rows import ROW


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """An effect with numbers that were fitted to all joints at once.

    shared: parameters of the hand at their values, with their standard errors as scales.  starts: for each joint,
    coordinates [-] by row at which its own fit begins.  log_evidence: of all joints with it.  without: that of what was
    found joint by joint.  rivals: other effects in its place, with their evidence.
    """

    effect: Effect
    shared: tuple[FreeParameter, ...]
    starts: Mapping[str, Mapping[int, float]]
    log_evidence: float
    without: float
    rivals: tuple[tuple[Effect, float], ...] = ()

    @property
    def gain(self) -> float:
        """Log evidence [nats] over what was found joint by joint."""
        return self.log_evidence - self.without

    def parameters(self, joint: str, nominal: Array) -> list[FreeParameter]:
        """Free parameters of the effect on a joint with these nominal numbers (rows,): shared ones are fixed."""
        law = [key for key in self.effect.coefficients if ROW[key] in self.starts[joint]]
        return [*_parameters(self.effect, nominal, law)[0], *self.shared]


@dataclass(frozen=True, slots=True)
class _Side:
    """A joint: its search, fits of the plain model and of what was found, and the same without the effect in question.

    plain, found: fits at the practical floor.  others: those of its free parameters that are left without the effect.
    """

    search: JointSearch
    plain: MapFit
    found: MapFit
    others: MapFit

    @property
    def choices(self) -> tuple[MapFit, ...]:
        """Models to which the cause may be added."""
        return (self.plain,) if len(self.others.free) == len(self.plain.free) else (self.plain, self.others)


def whole_hand_cause(
    searches: Sequence[JointSearch], effects: Sequence[Effect], rng: np.random.Generator
) -> Cause | None:
    """The cause with the most evidence over what was found joint by joint; None where none has enough."""
    causes, tried = [], []
    fitted = [_at_floor(search) for search in searches]
    for effect in effects:
        taking = [each for each in fitted if effect.of_the_hand or _has(each.search, effect)]
        if not effect.shared or len(taking) < 2:
            continue
        cause = _cause(taking, effect, rng)
        if cause is None:
            continue
        tried.append(cause)
        if cause.gain > (SETTINGS.min_log_evidence if effect.of_the_hand else 0.0):
            causes.append(cause)
    if not causes:
        return None
    best = max(causes, key=lambda cause: cause.gain)
    others = [(each.effect, best.without + each.gain) for each in tried if each is not best]
    return replace(best, rivals=tuple(others))


def with_cause(cause: Cause, found: JointSearch, current: MapFit, rng: np.random.Generator) -> Hypothesis:
    """The cause as an effect of a joint whose search begins; adds the round in which it was chosen to the search."""
    problem = found.problem
    given = cause.parameters(problem.joint, problem.nominal)
    free = merged(current.free, given)
    start = start_at(free, current.by_row | dict(cause.starts[problem.joint]))
    fit = map_fit(problem, free, start, SETTINGS.nominal_iterations)
    freed = tuple(p.key for p in given if p.key in cause.effect.coefficients)
    added = replace(judged(problem, current, cause.effect, fit, rng), freed=freed, given=tuple(given))
    own = replace(added, log_evidence=cause.log_evidence, fit=fit.without_arrays())
    rivals = [replace(own, effect=effect, log_evidence=evidence, freed=()) for effect, evidence in cause.rivals]
    found.rounds.append(sorted([own, *rivals], key=lambda hypothesis: -hypothesis.log_evidence))
    found.evidences.append(cause.without)
    return added


def _has(search: JointSearch, effect: Effect) -> bool:
    return any(hypothesis.effect is effect and not hypothesis.given for hypothesis in search.accepted)


def _cause(fitted: Sequence[_Side], effect: Effect, rng: np.random.Generator) -> Cause | None:
    """The best fit of an effect to all joints at once; None where fewer than two joints show it."""
    sides = [_without(side, effect) for side in fitted]
    start = _best_start(sides, effect)
    if start is None:
        return None
    shared, at = start
    plans = [[side.plain for side in sides]]
    if any(len(side.choices) > 1 for side in sides):
        plans.append([side.others for side in sides])
    tried = [_fitted(sides, plan, effect, shared, at) for plan in plans]
    best = max(tried, key=lambda pair: pair[0])
    needed = [_needed(side, effect, best[1]) for side in sides]
    if not any(all(a is b for a, b in zip(needed, plan, strict=True)) for plan in plans):
        best = max(best, _fitted(sides, needed, effect, best[1].shared, best[1].z), key=lambda pair: pair[0])
    best = max(best, _with_law(sides, needed, effect, best, rng), key=lambda pair: pair[0])
    evidence, found = best
    showing = sum(_shows(side, effect, found) for side in sides)
    if effect.of_the_hand and showing < 2:
        return None
    without = sum(log_evidence(side.search.problem, side.found, amounts(side.found)) for side in sides)
    return _as_cause(sides, effect, found, evidence, without)


def _at_floor(search: JointSearch) -> _Side:
    """A joint with its models fitted at the practical floor; only the plain one keeps its large arrays."""
    problem, final = search.problem, search.final
    plain = map_fit(problem, search.base.free, search.base.z, SETTINGS.nominal_iterations)
    found = map_fit(problem, final.free, final.z, SETTINGS.nominal_iterations) if search.accepted else plain
    found = found.without_arrays()
    return _Side(search, plain, found, found)


def _without(side: _Side, effect: Effect) -> _Side:
    """The joint with the model that is left without an effect, where it has it."""
    search, found, problem = side.search, side.found, side.search.problem
    rows = {ROW[key] for key in (*effect.keys, *effect.coefficients)}
    if not any(parameter.row in rows for parameter in found.free):
        return side
    free = list(search.base.free)
    for hypothesis in search.accepted:
        if hypothesis.effect is not effect and not hypothesis.given:
            free = merged(free, hypothesis.free_parameters(problem.nominal))
    others = map_fit(problem, free, start_at(free, found.by_row), SETTINGS.nominal_iterations)
    return replace(side, others=others.without_arrays())


def _parameters(
    effect: Effect, nominal: Array, law: Collection[str] = ()
) -> tuple[list[FreeParameter], list[FreeParameter]]:
    """Private and shared free parameters of an effect around nominal numbers (rows,). law: its free coefficients."""
    own = effect_free_parameters(effect, nominal)
    have = {parameter.row for parameter in own}
    own += [p for p in law_free_parameters(effect, nominal) if p.row not in have and p.key in law]
    return [p for p in own if p.key not in effect.shared], [p for p in own if p.key in effect.shared]


def _parts(sides: Sequence[_Side], plan: Sequence[MapFit], effect: Effect) -> list[Part]:
    """Each joint with the free parameters of its plan and the private ones of the effect, for a coarse fit."""
    parts = []
    for side, fit in zip(sides, plan, strict=True):
        problem = side.search.problem
        private, _ = _parameters(effect, problem.nominal, _freed(side, effect))
        free = merged(fit.free, private)
        # Numbers that were fitted together with the effect are the better start where the joint has it already.
        first, second = (fit, side.found) if side.others is not side.found else (side.found, fit)
        start = start_at(free, first.by_row | second.by_row)
        parts.append(Part(replace(problem, step_s=SETTINGS.passes[0].step_s), free, start))
    return parts


def _best_start(sides: Sequence[_Side], effect: Effect) -> tuple[list[FreeParameter], Array] | None:
    """The shared parameters and the coordinates from which all joints together get cheapest in a few steps."""
    nominal = sides[0].search.problem.nominal
    law = {key for side in sides for key in _freed(side, effect) if key in effect.shared}
    _, shared = _parameters(effect, nominal, law)
    starts = _probed(sides, effect, shared) if effect.of_the_hand else []
    for side in sides:
        known = side.found.by_row
        if any(parameter.row in known for parameter in shared):
            starts.append(start_at(shared, known))
    if not starts:
        return None
    parts = _parts(sides, [side.plain for side in sides], effect)
    short = SETTINGS.cause_iterations[0]
    tried = sorted((shared_fit(parts, shared, start, short) for start in starts), key=lambda fit: fit.cost)
    ended = [shared_fit(parts, shared, fit.z, SETTINGS.cause_iterations[1]) for fit in tried[:2]]
    return shared, min(ended, key=lambda fit: fit.cost).z


def _freed(side: _Side, effect: Effect) -> tuple[str, ...]:
    """Coefficients of the effect's law that were freed on a joint."""
    return next((h.freed for h in side.search.accepted if h.effect is effect), ())


def _probed(sides: Sequence[_Side], effect: Effect, shared: Sequence[FreeParameter]) -> list[Array]:
    """Coordinates (shared,) of the probes that promise most to all joints together, at the share that they promise."""
    promised = [promised_shares(side.search.problem, side.plain, effect) for side in sides]
    own, toward = (np.sum([each[k] for each in promised], axis=0) for k in (0, 1))
    share = np.clip(toward / own, 0.0, SETTINGS.max_probe_share)
    gain = share * (2.0 * toward - share * own)
    probes = probe_values(effect, sides[0].search.problem.nominal)
    starts = []
    for k in np.argsort(-gain)[: SETTINGS.cause_starts]:
        size = min(max(float(share[k]), SETTINGS.start_share_low), SETTINGS.start_share_high)
        starts.append(np.array([_toward(parameter, probes[k], size, effect) for parameter in shared]))
    return starts


def _toward(parameter: FreeParameter, probe: Mapping[int, float], share: float, effect: Effect) -> float:
    """The coordinate a share of the way from the neutral value to a probe; all of the way for a shape."""
    if parameter.row not in probe:
        return 0.0
    value = probe[parameter.row]
    if parameter.key in effect.shape or parameter.log:
        return parameter.coordinate(value)
    return parameter.coordinate(parameter.centre + share * (value - parameter.centre))


def _fitted(
    sides: Sequence[_Side], plan: Sequence[MapFit], effect: Effect, shared: Sequence[FreeParameter], start: Array
) -> tuple[float, SharedFit]:
    """Log evidence and fit of all joints by a plan, from shared coordinates (shared,)."""
    problems = [side.search.problem for side in sides]
    found = shared_fit(_parts(sides, plan, effect), shared, start, SETTINGS.cause_iterations[1])
    near = [Part(problem, fit.free, fit.z) for problem, fit in zip(problems, found.fits, strict=True)]
    found = shared_fit(near, shared, found.z, SETTINGS.cause_iterations[1])
    count = len(shared)
    groups = [amounts(replace(fit, free=fit.free[: len(fit.free) - count])) for fit in found.fits]
    own = amounts(replace(found.fits[0], free=tuple(shared)))
    return shared_log_evidence(problems, found, groups, own), found


def _with_law(
    sides: Sequence[_Side],
    plan: Sequence[MapFit],
    effect: Effect,
    best: tuple[float, SharedFit],
    rng: np.random.Generator,
) -> tuple[float, SharedFit]:
    """The fit with the coefficients of the law that are those of the hand, where that has clearly more evidence."""
    law = [key for key in effect.coefficients if key in effect.shared]
    _, shared = _parameters(effect, sides[0].search.problem.nominal, law)
    evidence, found = best
    if len(shared) == len(found.shared):
        return best
    known = {p.row: float(z) for p, z in zip(found.shared, found.z, strict=True)}
    at = start_at(shared, known)
    new = np.array([parameter.row not in known for parameter in shared])
    tried = [_fitted(sides, plan, effect, shared, start) for start in (at, at + new * rng.standard_normal(len(at)))]
    lawful = max(tried, key=lambda pair: pair[0])
    return lawful if lawful[0] > evidence + SETTINGS.min_log_evidence else best


def _given(found: SharedFit) -> list[FreeParameter]:
    return [fixed(p, float(p.value(np.array([z]))[0])) for p, z in zip(found.shared, found.z, strict=True)]


def _with_numbers_of(side: _Side, effect: Effect, fit: MapFit, found: SharedFit) -> MapFit:
    """A model of a joint fitted again with the shared numbers as they were found."""
    problem = side.search.problem
    private, _ = _parameters(effect, problem.nominal, _freed(side, effect))
    free = merged(merged(fit.free, private), _given(found))
    return map_fit(problem, free, start_at(free, fit.by_row), SETTINGS.nominal_iterations)


def _needed(side: _Side, effect: Effect, found: SharedFit) -> MapFit:
    """The model of a joint with the most evidence once the shared numbers are as they were found."""
    fits = [_with_numbers_of(side, effect, choice, found) for choice in side.choices]
    evidence = [log_evidence(side.search.problem, fit, amounts(fit)) for fit in fits]
    return side.choices[int(np.argmax(evidence))]


def _shows(side: _Side, effect: Effect, found: SharedFit) -> bool:
    """Whether the plain model of a joint has clearly more evidence with the cause than without."""
    problem, fit = side.search.problem, _with_numbers_of(side, effect, side.plain, found)
    gain = log_evidence(problem, fit, amounts(fit)) - log_evidence(problem, side.plain)
    return gain > SETTINGS.min_log_evidence


def _as_cause(sides: Sequence[_Side], effect: Effect, found: SharedFit, evidence: float, without: float) -> Cause:
    precision = found.precision()
    errors, alone = np.sqrt(np.diag(posterior_of(precision)[0])), 1.0 / np.sqrt(np.diag(precision))
    shared = []
    for parameter, z, error, own in zip(found.shared, found.z, errors, alone, strict=True):
        value = float(parameter.value(np.array([z]))[0])
        value = _rounded(value, SETTINGS.cause_step * parameter.deviation(value, float(own)))
        shared.append(fixed(parameter, value, parameter.deviation(value, float(error))))
    count = len(shared)
    starts = {
        side.search.problem.joint: {p.row: float(z) for p, z in zip(fit.free[:-count], fit.z[:-count], strict=True)}
        for side, fit in zip(sides, found.fits, strict=True)
    }
    return Cause(effect=effect, shared=tuple(shared), starts=starts, log_evidence=evidence, without=without)


def _rounded(value: float, step: float) -> float:
    """The value with as many digits as a step of this size needs."""
    return round(value, max(0, -int(np.floor(np.log10(step))))) if step > 0.0 else value
