"""Hypotheses: effects in addition to the accepted ones, screened, fitted, and weighed by their evidence.

Screening is of first order. A probe of an effect changes the prediction by s; the residual r is explained by
alpha s + J dz, with alpha within 0 ... SETTINGS.max_probe_share and dz, the change of the free parameters, under its
prior. What the free parameters explain alone is not counted for the probe.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hand_diagnosis.problem import block_bootstrap, fitted_rmse, log_evidence, validation_rmse
from hand_diagnosis.search.horizons import from_the_first_part, is_released
from hand_diagnosis.settings import SETTINGS, FitPass
from hand_identification.free_parameters import (
    START_CREEP,
    FreeParameter,
    effect_free_parameters,
    law_free_parameters,
    law_probe_values,
    law_scales,
    merged,
    probe_values,
)
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, costs_at, map_fit
from hand_identification.starts import Way, has_expected_value
from hand_model.arrays import Array
from hand_model.effects import EFFECTS
from hand_model.effects.effect import Effect
from hand_model.kernel.plant_rows import PLANT_PARAMETERS
from hand_model.kernel.rows import ROW


@dataclass(frozen=True, slots=True)
class Screened:
    """An effect, the fall of the cost that its best probe promises, and where to start: values by row (SI), share.

    imitated: largest share of a probe's square that the free parameters take; their equations are bent over such ways,
    and the promise is not worth much.  plain: its textbook form, where it starts with a coefficient of its law and that
    form promises something as well.
    """

    effect: Effect
    gain: float
    start: dict[int, float]
    share: float
    imitated: float = 0.0
    plain: Screened | None = None


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """An effect in addition to those already accepted: its fit and log evidence, and what the validation data say.

    stage: that gains most.  fall: 95 % interval of the relative fall of its validation mean square.
    freed: coefficients of the effect's law that the fit has; none for the textbook form.  textbook: the fit of the
    textbook form where the law is learned.  given: its free parameters where it is a cause of the whole hand, whose
    numbers other joints have set as well; no joint removes it.
    """

    effect: Effect
    fit: MapFit
    log_evidence: float
    stage: int
    fall: tuple[float, float]
    freed: tuple[str, ...] = ()
    textbook: MapFit | None = None
    given: tuple[FreeParameter, ...] = ()

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the parameters that the effect and its law set free."""
        return (*self.effect.keys, *self.freed)

    def free_parameters(self, nominal: Array) -> list[FreeParameter]:
        """Free parameters of the effect and of its learned law around the nominal numbers (rows,), SI."""
        return list(self.given) or _with_law(self.effect, self.freed, nominal)


def _with_law(effect: Effect, freed: Sequence[str], nominal: Array) -> list[FreeParameter]:
    """Free parameters of an effect and of the freed coefficients of its law, around nominal numbers (rows,)."""
    law = [parameter for parameter in law_free_parameters(effect, nominal) if parameter.key in freed]
    return effect_free_parameters(effect, nominal) + law


@dataclass(frozen=True, slots=True)
class Probes:
    """Probes of effects around a fit: (effect, values by row) of each, and their parameter sets (probes, rows)."""

    probes: list[tuple[Effect, dict[int, float]]]
    columns: Array
    starts: Array

    def changed_residuals(self, problem: JointProblem, at_once: int) -> Iterator[tuple[slice, list[Array]]]:
        """Residuals (k, OUTPUTS, T) by segment, of `at_once` probes at a time, with their places among the probes."""
        for first in range(0, len(self.probes), at_once):
            part = slice(first, first + at_once)
            count = len(self.columns[part])
            yield part, problem.residuals(self.columns[part], np.repeat(self.starts, count, axis=0))


def probes_at(
    problem: JointProblem,
    fit: MapFit,
    effects: Sequence[Effect],
    values_of: Callable[[Effect, Array], list[dict[int, float]]] = probe_values,
) -> Probes:
    """Every probe of the effects, each set into the fit's parameters.

    values_of: the probes of an effect around nominal numbers (rows,), SI.
    """
    base, starts = problem.columns(fit.free, fit.z[None])
    probes = [(effect, values) for effect in effects for values in values_of(effect, base[0])]
    columns = np.repeat(base, len(probes), axis=0)
    for column, (_, values) in zip(columns, probes, strict=True):
        for row, value in values.items():
            column[row] = value
    return Probes(probes, columns, starts)


def screen(problem: JointProblem, fit: MapFit, effects: Sequence[Effect], *, laws: bool = False) -> list[Screened]:
    """Every effect by its best probe, the most promising first.

    laws: whether its law is probed, too, where the recording shows much; it then has to promise clearly more.
    """
    best = _screened(problem, fit, probes_at(problem, fit, effects))
    if laws:
        learned = [effect for effect in effects if effect.coefficients]
        for name, found in _screened(problem, fit, probes_at(problem, fit, learned, law_probe_values)).items():
            plain = best.get(name)
            promised = plain.gain if plain is not None else 0.0
            if found.gain > max(SETTINGS.law_probe_gain * promised, promised + 2.0 * SETTINGS.strong_log_evidence):
                best[name] = replace(found, plain=plain)
    for effect in effects:
        relief = _relief(fit, effect)
        known = best.get(effect.name, Screened(effect, 0.0, {}, 1.0))
        if relief > known.gain:
            best[effect.name] = Screened(effect, relief, {}, 1.0, known.imitated)
    return sorted(best.values(), key=lambda screened: -screened.gain)


def _screened(problem: JointProblem, fit: MapFit, tried: Probes) -> dict[str, Screened]:
    """The best probe of each effect, by its name."""
    gains, shares, imitated = np.zeros((3, len(tried.probes)))
    long = sum(len(segment.angle_rad) for segment in problem.segments) >= SETTINGS.long_recording_samples
    at_once = SETTINGS.probes_at_once_long if long else SETTINGS.probes_at_once
    for part, changed in tried.changed_residuals(problem, at_once):
        gains[part], shares[part], imitated[part] = _gains(problem, fit, changed)
    best: dict[str, Screened] = {}
    taken: dict[str, float] = {}
    for (effect, values), gain, share, part in zip(tried.probes, gains, shares, imitated, strict=True):
        taken[effect.name] = max(float(part), taken.get(effect.name, 0.0))
        if effect.name not in best or gain > best[effect.name].gain:
            best[effect.name] = Screened(effect, float(gain), values, float(share))
    return {name: replace(found, imitated=taken[name]) for name, found in best.items()}


def _relief(fit: MapFit, effect: Effect) -> float:
    """Prior cost of the nominal numbers that an effect sets free: what they paid for leaving their tolerance."""
    rows = {ROW[key] for key in effect.keys}
    return float(sum(z * z for parameter, z in zip(fit.free, fit.z, strict=True) if parameter.row in rows))


def promised_shares(problem: JointProblem, fit: MapFit, effect: Effect) -> tuple[Array, Array]:
    """Of every probe of an effect around a fit with sensitivities, its own square and the product with the residual,
    both without what the free parameters explain, (probes,) each.
    """
    tried = probes_at(problem, fit, [effect])
    parts = [
        _products(problem, fit, changed) for _, changed in tried.changed_residuals(problem, SETTINGS.probes_at_once)
    ]
    own, toward = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    return own, toward


def _gains(problem: JointProblem, fit: MapFit, changed: Sequence[Array]) -> tuple[Array, Array, Array]:
    """Of each probe, the fall of the cost, the share of the probe that brings most, and what is imitated, (probes,)."""
    own, toward, square = _products(problem, fit, changed)
    share = np.clip(toward / own, 0.0, SETTINGS.max_probe_share)
    imitated = np.where(square > SETTINGS.min_promised_gain, 1.0 - own / np.maximum(square, own), 0.0)
    return share * (2.0 * toward - share * own), share, imitated


def _products(problem: JointProblem, fit: MapFit, changed: Sequence[Array]) -> tuple[Array, Array, Array]:
    """Squares of the probes and their products with the residual without what the free parameters explain; squares."""
    train = (~problem.validation).astype(float)
    count, free = len(changed[0]), len(fit.z)
    ss, sr = np.zeros(count), np.zeros(count)
    cross, slope = np.zeros((count, free)), np.zeros(free)
    for segment, residual, slopes, other in zip(problem.segments, fit.residuals, fit.sensitivity, changed, strict=True):
        root = segment.trust * np.sqrt(problem.weight)[:, None] * train[segment.block][None]
        r = (residual * root).ravel()
        j = (slopes * root).reshape(free, -1)
        other -= residual  # in place: these arrays are large for recordings of ten minutes
        other *= root
        s = np.nan_to_num(other, copy=False, posinf=0.0, neginf=0.0).reshape(count, -1)
        ss += (s * s).sum(axis=1)
        sr += s @ r
        cross += s @ j.T
        slope += j @ r
    covariance = fit.covariance
    own = np.maximum(ss - np.einsum("pm,mn,pn->p", cross, covariance, cross), 1e-9 * ss + 1e-12)
    return own, -(sr - cross @ covariance @ (slope + fit.z)), ss


def promising(
    problem: JointProblem, current: MapFit, effects: Sequence[Effect], *, laws: bool = False
) -> list[Screened]:
    """Effects to fit, by the predicted gain of their probes; where every gain is small, also by the cost of starts.

    Effects that the nominal numbers imitate are tried, too: those numbers have moved to where such an effect promises
    little. Twice as many of an axis that was released, where no promise is worth much: its errors are not proportional
    to what is missing. laws: see `screen`.
    """
    coarse = SETTINGS.passes[0]
    most = 2 * coarse.most if is_released(problem) else coarse.most
    screened = screen(problem, current, effects, laws=laws)
    worth = [found for found in screened if found.gain > SETTINGS.min_promised_gain]
    if not worth:
        return []
    count = min(len(worth), most)
    chosen, further = screened[:count], screened[count:]
    much = worth[0].gain > SETTINGS.min_promised_share * current.cost
    if not much:
        begun = [(float(_begin(problem, current, each, coarse)[2].min()), each) for each in further]
        limit = current.cost - SETTINGS.min_promised_gain
        begun = sorted((pair for pair in begun if pair[0] < limit), key=lambda pair: pair[0])
        chosen += [found for _, found in begun[:most]]
    names = {found.effect.name for found in chosen}
    hidden = [each for each in further if each.imitated > SETTINGS.hidden_share and each.effect.name not in names]
    least = max(SETTINGS.min_promised_gain, SETTINGS.hidden_gain * worth[0].gain)
    tried = [found for found in (_tried(problem, current, each) for each in hidden) if found.gain > least]
    tried.sort(key=lambda found: -found.gain)
    return sorted([*chosen, *tried], key=lambda found: -found.gain)[:most] if much else [*chosen, *tried[:most]]


def _tried(problem: JointProblem, current: MapFit, screened: Screened) -> Screened:
    """An effect with the fall of the cost that a short fit from its cheapest start brings."""
    coarse = SETTINGS.passes[0]
    free, starts, costs = _begin(problem, current, screened, coarse)
    rough = replace(problem, step_s=coarse.step_s)
    fit = map_fit(rough, free, starts[int(np.argmin(costs))], SETTINGS.hidden_iterations, coarse.tolerance)
    return replace(screened, gain=current.cost - fit.cost)


def fit_roughly(problem: JointProblem, current: MapFit, screened: Screened, rng: np.random.Generator) -> Hypothesis:
    """The hypothesis of an effect by the first, coarse pass, from the screen's start and from the cheapest one.

    Of an axis that was released, also from where the latter leads in the first part of its recordings. Of a law and its
    textbook form, the form counts unless the law has clearly more evidence.
    """
    coarse = SETTINGS.passes[0]
    rough = replace(problem, step_s=coarse.step_s)
    free, starts, costs = _begin(problem, current, screened, coarse)
    cheapest = starts[1 + int(np.argmin(costs[1:]))]
    begun = [starts[0], cheapest]
    if is_released(problem):
        begun.append(from_the_first_part(rough, free, cheapest, coarse))
    tried = [map_fit(rough, free, start, coarse.iterations, coarse.tolerance) for start in begun]
    best = min(tried, key=lambda fit: fit.cost)
    made = replace(judged(problem, current, screened.effect, best.without_arrays(), rng), freed=_freed(screened))
    if screened.plain is None:
        return made
    plain = fit_roughly(problem, current, screened.plain, rng)
    return made if made.log_evidence > plain.log_evidence + SETTINGS.min_log_evidence else plain


def _freed(screened: Screened) -> tuple[str, ...]:
    """Coefficients of its law with which an effect starts, and the scales of the law with them."""
    effect, own = screened.effect, screened.effect.keys
    started = tuple(key for key in effect.coefficients if ROW[key] in screened.start and key not in own)
    scales = (key for key in law_scales(effect) if key not in (*started, *own))
    return (*started, *scales) if started else ()


def refined(
    problem: JointProblem, current: MapFit, rough: Hypothesis, fit_pass: FitPass, rng: np.random.Generator
) -> Hypothesis:
    """A hypothesis whose fit is continued by a later pass."""
    stepped = replace(problem, step_s=fit_pass.step_s)
    fit = map_fit(stepped, rough.fit.free, rough.fit.z, fit_pass.iterations, fit_pass.tolerance)
    return with_other_fit(problem, current, rough, fit, rng)


def with_other_fit(
    problem: JointProblem, current: MapFit, before: Hypothesis, fit: MapFit, rng: np.random.Generator
) -> Hypothesis:
    """A hypothesis with another fit of the same parameters, compared with the current one again."""
    made = judged(problem, current, before.effect, fit, rng)
    return replace(made, freed=before.freed, textbook=before.textbook, given=before.given)


def judged(problem: JointProblem, current: MapFit, effect: Effect, fit: MapFit, rng: np.random.Generator) -> Hypothesis:
    """A fit with an effect, compared with the current one on the validation data, and on all that is fitted.

    An event, as a stop that is met once, may lie between two validation blocks. Where the plant changes inside the
    recording, strong evidence stands against an effect that is a part of the machine's build; and where nothing is
    there that it refines, against a finer form.
    """
    with np.errstate(invalid="ignore"):
        gains = [
            (rmse(problem, current.squares) - rmse(problem, fit.squares)) / problem.floor
            for rmse in (validation_rmse, fitted_rmse)
        ]
    stage = int(np.argmax(np.nan_to_num(gains, nan=-np.inf).max(axis=0)))  # never a signal that was not recorded
    fall = block_bootstrap(problem, current.squares, fit.squares, stage, rng)
    unlikely = (effect.lasting and problem.switched) or not _has_refined(problem, current, effect)
    against = SETTINGS.strong_log_evidence if unlikely else 0.0
    return Hypothesis(effect, fit, log_evidence(problem, fit, amounts(fit)) - against, stage, fall)


def _has_refined(problem: JointProblem, current: MapFit, effect: Effect) -> bool:
    """Whether the current model, or the nominal numbers, have an effect of which this one is a finer form, if it is."""
    if not effect.refines:
        return True
    found = {parameter.key.partition(".")[0] for parameter in current.free}
    given = (own for name in effect.refines for own in EFFECTS[name].parameters)
    return not found.isdisjoint(effect.refines) or any(problem.nominal[ROW[own.key]] != own.neutral_si for own in given)


def amounts(fit: MapFit) -> list[list[int]]:
    """For each effect, indices of the parameters that say how much; each may be neutral while others act.

    Coefficients of a learned law are not among them: the determinant counts what the data know of them.
    """
    found: dict[str, list[int]] = {}
    for k, parameter in enumerate(fit.free):
        name = parameter.key.partition(".")[0]
        own = len(PLANT_PARAMETERS) <= parameter.row < START_CREEP and not (parameter.log or parameter.is_fixed)
        if own and parameter.key not in (*EFFECTS[name].shape, *EFFECTS[name].coefficients):
            found.setdefault(name, []).append(k)
    return list(found.values())


def _begin(
    problem: JointProblem, current: MapFit, screened: Screened, fit_pass: FitPass
) -> tuple[list[FreeParameter], Array, Array]:
    """Free parameters of the model with an effect, points to start from (k, free), the screen's first, costs (k,)."""
    free = merged(current.free, _with_law(screened.effect, _freed(screened), problem.nominal))
    starts = np.array(_starts(problem, current, screened, free))
    return free, starts, costs_at(replace(problem, step_s=fit_pass.step_s), free, starts)


def _starts(
    problem: JointProblem, current: MapFit, screened: Screened, free: Sequence[FreeParameter]
) -> list[list[float]]:
    """Coordinates to start from: the screen's own first, then probes at several shares of the way to them.

    Each of the latter twice: with the nominal numbers as they are, and released to their expected values. A large
    effect has shifted the nominal numbers; from their expected values the way to the solution is shorter.
    """
    columns, _ = problem.columns(current.free, current.z[None])
    here = {parameter.row: float(z) for parameter, z in zip(current.free, current.z, strict=True)}
    own = {ROW[key] for key in (*screened.effect.keys, *_freed(screened))}
    others = [probe for probe in probe_values(screened.effect, columns[0]) if probe != screened.start]
    share = min(max(screened.share, SETTINGS.start_share_low), SETTINGS.start_share_high)
    way = Way(columns[0], here, screened.effect.shape)
    starts = [[way.coordinate(parameter, screened.start, share) for parameter in free]]
    for probe in [screened.start, *others][: SETTINGS.probes_tried]:
        for share in SETTINGS.probe_shares:
            start = [way.coordinate(parameter, probe, share) for parameter in free]
            released = [
                0.0 if parameter.row not in own and has_expected_value(parameter) else z
                for parameter, z in zip(free, start, strict=True)
            ]
            starts += [start, released]
    return starts
