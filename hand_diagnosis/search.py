"""From a joint's problem to the effects that explain it: forward, one effect at a time, then backward.

First the nominal numbers move within their tolerance. Then every effect is screened, the promising ones are fitted, and
the one with the most evidence is taken, if held-out data confirm it; up to MOST effects. An effect that the others make
superfluous is dropped again. No effect is treated differently from another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hand_diagnosis.evidence import block_bootstrap, held_out_rmse, log_evidence
from hand_diagnosis.polish import coloured, polished
from hand_diagnosis.screen import Screened, screen
from hand_identification.driving import shape_driving
from hand_identification.free_parameters import START_CREEP, FreeParameter, effect_free_parameters, merged, probe_values
from hand_identification.joint_problem import STAGES, JointProblem
from hand_identification.map_fit import MapFit, costs_at, map_fit
from hand_model.arrays import Array
from hand_model.effects import EFFECTS
from hand_model.effects.effect import Effect
from hand_model.kernel.plant_rows import PLANT_PARAMETERS
from hand_model.kernel.rows import ROW

MOST = 4


@dataclass(frozen=True, slots=True)
class FitPass:
    """Fits of the `most` best hypotheses of the pass before. step_s: largest step of integration, longer is cheaper.

    tolerance: fall of the cost below which a fit ends.
    """

    most: int
    iterations: int
    tolerance: float
    step_s: float


BEHIND = 60.0
"""Log evidence behind the best hypothesis from which another one is not fitted to the end."""
WORTH_A_FIT = 8.0
"""Cost that a probe must promise to save."""
FORETOLD = 0.1
"""Share of the cost that the best probe must promise to save; else screening, which is linear, missed what is large."""
ACCEPTED = 6.0
"""Log evidence by which an effect must beat the model without it."""
CLAIMABLE = 0.03
"""Fall of the held-out error relative to itself that is worth a claim."""
STARTS, JITTER, ITERATIONS = 1, 0.5, 12
"""Further starts of the fit of an effect to be accepted; how far off they are, in priors' widths; their iterations."""
PROBES, SHARES = 6, (0.1, 0.3, 1.0, 2.5, 6.0)
"""Starts of a fit: probes of the effect, and shares of the way to them."""
LISTED, WORTH_LISTING = 3, 0.2
"""Improvements too small to be claimed that are listed, and what they must take away, in floors."""
FIT_PASSES = (FitPass(8, 7, 2.0, 5.2e-3), FitPass(5, 10, 0.5, 5.2e-3), FitPass(3, 20, 0.02, 2.6e-3))
"""Of every round: the first ones are rough, to see what is worth the last."""


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """An effect beside those already accepted: its fit and log evidence, and what held-out data say.

    fall: 95 % interval of the relative fall of the held-out mean square, of the stage that gains most.
    """

    effect: Effect
    fit: MapFit
    log_evidence: float
    stage: int
    fall: tuple[float, float]


@dataclass(frozen=True, slots=True)
class NotClaimable:
    """An improvement that held-out data confirm and that is too small to be claimed, SI; below: what it is below."""

    effect: Effect
    stage: int
    taken: float
    floor: float
    below: str


@dataclass(slots=True)
class JointSearch:
    """What was found on a joint. rounds: the hypotheses of each round, the most evident first."""

    problem: JointProblem
    nominal: MapFit
    nominal_evidence: float
    accepted: list[Hypothesis] = field(default_factory=list)
    rounds: list[list[Hypothesis]] = field(default_factory=list)
    evidences: list[float] = field(default_factory=list)
    not_claimable: list[NotClaimable] = field(default_factory=list)

    @property
    def final(self) -> MapFit:
        """The fit of the best model."""
        return self.accepted[-1].fit if self.accepted else self.nominal

    @property
    def effect_keys(self) -> frozenset[str]:
        """Numbers of the effects found; what else moved is a nominal number."""
        return frozenset(key for one in self.accepted for key in one.effect.keys)

    def with_effects_off(self, *names: str) -> MapFit:
        """The best model with effects switched off (all, where none is named): what is left shows where they act.

        The nominal model, fitted without them, has spread over everything what they do at one place.
        """
        off = [one.effect for one in self.accepted if not names or one.effect.name in names]
        if not off:
            return self.final
        columns, starts = self.problem.columns(self.final.free, self.final.z[None])
        rows = [ROW[key] for effect in off for key in effect.keys]
        columns[:, rows] = self.problem.nominal[rows]
        residuals = self.problem.residuals(columns, starts)
        squares = self.problem.block_squares(residuals)[0]
        return replace(self.final, squares=squares, residuals=tuple(r[0] for r in residuals), sensitivity=())


def search_joint(
    problem: JointProblem,
    effects: Sequence[Effect],
    base: Sequence[FreeParameter],
    rng: np.random.Generator,
    start: Array,
) -> JointSearch:
    """Explain one joint by the effects given. base: free parameters of its nominal numbers; the fit begins at start."""
    nominal = map_fit(problem, base, start, 8)
    found = JointSearch(problem, nominal, log_evidence(problem, nominal))
    current, evidence = nominal, found.nominal_evidence
    left = list(effects)
    for _ in range(MOST):
        hypotheses = _round(problem, current, left, rng)
        found.rounds.append(hypotheses)
        found.evidences.append(evidence)
        best = next((one for one in hypotheses if _confirmed(problem, current, one)), None)
        if best is not None and not best.fit.residuals:  # only fitted roughly so far
            best = _refine(problem, current, best, FIT_PASSES[-1], rng)
        if best is None or best.log_evidence < evidence + ACCEPTED:
            found.not_claimable += _too_small(problem, current, hypotheses)
            break
        best, scatter = _from_other_starts(problem, current, best, rng)
        if _taken(problem, current, best) < scatter:
            taken = _taken(problem, current, best)
            below = "the scatter of the fit over its starting points"
            found.not_claimable.append(NotClaimable(best.effect, best.stage, taken, scatter, below))
            break
        found.accepted.append(best)
        current, evidence = best.fit, best.log_evidence
        if STAGES[best.stage] == "pressure":
            current, evidence = _driven_anew(found, current)
        left = [effect for effect in left if effect.name != best.effect.name]
    _prune(found)
    _polish(found)
    found.rounds = [[replace(one, fit=one.fit.without_arrays()) for one in hypotheses] for hypotheses in found.rounds]
    found.accepted[:-1] = [replace(one, fit=one.fit.without_arrays()) for one in found.accepted[:-1]]
    return found


def rough_evidence(
    problem: JointProblem, effects: Sequence[Effect], base: Sequence[FreeParameter], rng: np.random.Generator
) -> float:
    """Log evidence of the best model with one effect at most, fitted roughly."""
    nominal = map_fit(problem, base, np.zeros(len(base)), 8)
    fits = [_fit(problem, nominal, one, FIT_PASSES[0], rng) for one in _promising(problem, nominal, effects)]
    return max([log_evidence(problem, nominal), *(one.log_evidence for one in fits)])


def _driven_anew(found: JointSearch, current: MapFit) -> tuple[MapFit, float]:
    """The current model and its evidence, the joint driven by the pressure that a now better valve's model gives.

    What the first model left of the readings had steps, and could not be smoothed for long.
    """
    problem = found.problem
    shape_driving(problem, current.free, current.z)
    found.nominal = map_fit(problem, found.nominal.free, found.nominal.z, 8)
    current = map_fit(problem, current.free, current.z, 8)
    found.accepted[-1] = replace(found.accepted[-1], fit=current)
    return current, log_evidence(problem, current, _amounts(current))


def _round(
    problem: JointProblem, current: MapFit, effects: Sequence[Effect], rng: np.random.Generator
) -> list[Hypothesis]:
    first, *further = FIT_PASSES
    ranked = _ranked([_fit(problem, current, one, first, rng) for one in _promising(problem, current, effects)])
    for fit_pass in further:
        ranked = [replace(one, fit=one.fit.without_arrays()) for one in ranked]
        near = ranked[: fit_pass.most]
        if fit_pass is FIT_PASSES[-1]:
            near = [one for one in near if one.log_evidence > ranked[0].log_evidence - BEHIND]
        refined = [_refine(problem, current, one, fit_pass, rng) for one in near]
        ranked = _ranked(refined + ranked[len(near) :])
    return ranked


def _promising(problem: JointProblem, current: MapFit, effects: Sequence[Effect]) -> list[Screened]:
    """Effects worth a fit, by what probes promise; where all promise little of much, also by their cheapest starts."""
    fit_pass = FIT_PASSES[0]
    screened = screen(problem, current, effects)
    worth = [one for one in screened if one.gain > WORTH_A_FIT]
    if not worth or worth[0].gain > FORETOLD * current.cost:
        return worth[: fit_pass.most]
    rest = screened[len(worth[: fit_pass.most]) :]
    others = [(float(_begin(problem, current, one, fit_pass)[2].min()), one) for one in rest]
    others = sorted((pair for pair in others if pair[0] < current.cost - WORTH_A_FIT), key=lambda pair: pair[0])
    return worth[: fit_pass.most] + [one for _, one in others[: fit_pass.most]]


def _ranked(hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    return sorted(hypotheses, key=lambda one: -one.log_evidence)


def _fit(
    problem: JointProblem, current: MapFit, screened: Screened, fit_pass: FitPass, rng: np.random.Generator
) -> Hypothesis:
    rough = replace(problem, step_s=fit_pass.step_s)
    free, starts, costs = _begin(problem, current, screened, fit_pass)
    cheapest = starts[1 + int(np.argmin(costs[1:]))]
    tried = [map_fit(rough, free, start, fit_pass.iterations, fit_pass.tolerance) for start in (starts[0], cheapest)]
    best = min(tried, key=lambda fit: fit.cost)
    return _judge(problem, current, screened.effect, best.without_arrays(), rng)


def _refine(
    problem: JointProblem, current: MapFit, rough: Hypothesis, fit_pass: FitPass, rng: np.random.Generator
) -> Hypothesis:
    """A hypothesis fitted further."""
    stepped = replace(problem, step_s=fit_pass.step_s)
    fit = map_fit(stepped, rough.fit.free, rough.fit.z, fit_pass.iterations, fit_pass.tolerance)
    return _judge(problem, current, rough.effect, fit, rng)


def _judge(problem: JointProblem, current: MapFit, effect: Effect, fit: MapFit, rng: np.random.Generator) -> Hypothesis:
    rmse = held_out_rmse(problem, current.squares), held_out_rmse(problem, fit.squares)
    with np.errstate(invalid="ignore"):
        gain = np.nan_to_num((rmse[0] - rmse[1]) / problem.floor)
    stage = int(np.argmax(gain))
    fall = block_bootstrap(problem, current.squares, fit.squares, stage, rng)
    return Hypothesis(effect, fit, log_evidence(problem, fit, _amounts(fit)), stage, fall)


def _amounts(fit: MapFit) -> list[list[int]]:
    """Numbers of each effect that say how much; each may be neutral while others of its effect act."""
    amounts: dict[str, list[int]] = {}
    for k, parameter in enumerate(fit.free):
        name = parameter.key.partition(".")[0]
        own = len(PLANT_PARAMETERS) <= parameter.row < START_CREEP and not parameter.log
        if own and parameter.key not in EFFECTS[name].shape:
            amounts.setdefault(name, []).append(k)
    return list(amounts.values())


def _begin(
    problem: JointProblem, current: MapFit, screened: Screened, fit_pass: FitPass
) -> tuple[list[FreeParameter], Array, Array]:
    """Free parameters of the model with an effect, points to start from (k, free), the screen's first, costs (k,)."""
    free = merged(current.free, effect_free_parameters(screened.effect, problem.nominal))
    starts = np.array(_starts(problem, current, screened, free))
    return free, starts, costs_at(replace(problem, step_s=fit_pass.step_s), free, starts)


def _starts(
    problem: JointProblem, current: MapFit, screened: Screened, free: Sequence[FreeParameter]
) -> list[list[float]]:
    """Coordinates to start from: the screen's own first, then probes at several shares of them, the nominal numbers
    as they are, and released.

    A large effect has dragged the nominal numbers along; from where they are expected the way is shorter.
    """
    columns, _ = problem.columns(current.free, current.z[None])
    here = {parameter.row: float(z) for parameter, z in zip(current.free, current.z, strict=True)}
    own = {ROW[key] for key in screened.effect.keys}
    others = [probe for probe in probe_values(screened.effect, columns[0]) if probe != screened.start]
    liked, shape = min(max(screened.share, 0.1), 2.0), screened.effect.shape
    starts = [[_coordinate(parameter, screened.start, liked, columns[0], here, shape) for parameter in free]]
    for probe in [screened.start, *others][:PROBES]:
        for share in SHARES:
            start = [_coordinate(parameter, probe, share, columns[0], here, shape) for parameter in free]
            released = [
                0.0 if parameter.row not in own and _expected(parameter) else z
                for parameter, z in zip(free, start, strict=True)
            ]
            starts += [start, released]
    return starts


def _expected(parameter: FreeParameter) -> bool:
    """Whether it has an expected value to be released to: nominal numbers and first speeds."""
    return not parameter.log and (parameter.row < len(PLANT_PARAMETERS) or parameter.row > START_CREEP)


def _coordinate(
    parameter: FreeParameter,
    probe: dict[int, float],
    share: float,
    values: Array,
    here: dict[int, float],
    shape: Sequence[str],
) -> float:
    """A probe's value, a share of the way to it but for its shape; other coordinates as they are."""
    if parameter.row in probe:
        now, there = float(values[parameter.row]), probe[parameter.row]
        return parameter.coordinate(there if parameter.key in shape else now + share * (there - now))
    if parameter.row in here:
        return here[parameter.row]
    return parameter.coordinate(float(values[parameter.row])) if parameter.row < len(values) else 0.0


def _confirmed(problem: JointProblem, current: MapFit, hypothesis: Hypothesis) -> bool:
    """Held-out data improve for sure, by something worth saying."""
    before = held_out_rmse(problem, current.squares)[hypothesis.stage]
    after = held_out_rmse(problem, hypothesis.fit.squares)[hypothesis.stage]
    enough = before - after > CLAIMABLE * before and _large(problem, current, hypothesis)
    return bool(hypothesis.fall[0] > 0.0 and enough and _worst_improves(problem, current, hypothesis))


def _taken(problem: JointProblem, current: MapFit, hypothesis: Hypothesis) -> float:
    """Held-out error that an effect takes away, SI: the root of the fall of the mean square."""
    before, after = (held_out_rmse(problem, fit.squares)[hypothesis.stage] for fit in (current, hypothesis.fit))
    return float(np.sqrt(max(before**2 - after**2, 0.0)))


def _large(problem: JointProblem, current: MapFit, hypothesis: Hypothesis) -> bool:
    return _taken(problem, current, hypothesis) > float(problem.claimable[hypothesis.stage])


def _too_small(problem: JointProblem, current: MapFit, hypotheses: Sequence[Hypothesis]) -> list[NotClaimable]:
    """What held-out data confirm, below the repeatability."""
    small = []
    for one in hypotheses:
        taken, claimable = _taken(problem, current, one), float(problem.claimable[one.stage])
        if one.fall[0] > 0.0 and WORTH_LISTING * problem.floor[one.stage] < taken <= claimable:
            small.append(NotClaimable(one.effect, one.stage, taken, claimable, "what re-runs differ by"))
    return small[:LISTED]


def _from_other_starts(
    problem: JointProblem, current: MapFit, best: Hypothesis, rng: np.random.Generator
) -> tuple[Hypothesis, float]:
    """The best of several starts, and by how much those that fit as well differ from it in held-out error, SI."""
    fits = [best.fit]
    for _ in range(STARTS):
        start = best.fit.z + JITTER * rng.standard_normal(len(best.fit.z))
        fits.append(map_fit(problem, best.fit.free, start, ITERATIONS))
    fits.sort(key=lambda fit: fit.cost)
    alike = [fit for fit in fits if fit.cost < fits[0].cost + ACCEPTED]
    errors = [held_out_rmse(problem, fit.squares)[best.stage] for fit in alike]
    chosen = best if fits[0] is best.fit else _judge(problem, current, best.effect, fits[0], rng)
    return chosen, float(np.ptp(errors))


def _worst_improves(problem: JointProblem, current: MapFit, hypothesis: Hypothesis) -> bool:
    """The held-out window that was worst gets better, and no window becomes a worse one."""
    counts = problem.block_counts[hypothesis.stage]
    usable = problem.held_out & (counts > 0)
    before = current.squares[hypothesis.stage, usable] / counts[usable]
    after = hypothesis.fit.squares[hypothesis.stage, usable] / counts[usable]
    return bool(len(before) and after[int(np.argmax(before))] < before.max() and after.max() < before.max())


def _polish(found: JointSearch) -> None:
    """The first and the last model fitted below the practical floor, too, where more than noise is left."""
    if not coloured(found.problem, found.final):
        return
    if found.accepted:
        last = found.accepted[-1]
        found.accepted[-1] = replace(last, fit=polished(found.problem, last.fit))
    found.nominal = polished(found.problem, found.nominal)


def _prune(found: JointSearch) -> None:
    """Drop effects that the later ones made superfluous, the least needed first."""
    while len(found.accepted) > 1:
        names = [one.effect.name for one in found.accepted]
        evidence = found.accepted[-1].log_evidence
        trials = []
        for index in range(len(names) - 1):
            kept = [one.effect for k, one in enumerate(found.accepted) if k != index]
            free = list(found.nominal.free)
            for effect in kept:
                free = merged(free, effect_free_parameters(effect, found.problem.nominal))
            final = found.final
            start = {parameter.row: z for parameter, z in zip(final.free, final.z, strict=True)}
            fit = map_fit(found.problem, free, np.array([start.get(parameter.row, 0.0) for parameter in free]), 8)
            trials.append((log_evidence(found.problem, fit, _amounts(fit)), index, fit))
        best = max(trials, key=lambda trial: trial[0])
        if best[0] < evidence - ACCEPTED / 2.0:
            return
        kept_hypotheses = [one for k, one in enumerate(found.accepted) if k != best[1]]
        last = kept_hypotheses[-1]
        kept_hypotheses[-1] = Hypothesis(last.effect, best[2], best[0], last.stage, last.fall)
        found.accepted = kept_hypotheses
