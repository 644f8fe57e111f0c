"""From a joint's problem to the effects that explain it: forward, one effect at a time, then backward.

First the nominal numbers move within their tolerance. Then every effect is screened, the promising ones are fitted, and
the one with the most evidence is taken, if held-out data confirm it; up to MOST effects. An effect that the others make
superfluous is dropped again. No effect is treated differently from another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from hand_diagnosis.evidence import block_bootstrap, held_out_rmse, log_evidence
from hand_diagnosis.screen import Screened, screen
from hand_ident.joint_problem import FLOOR, JointProblem
from hand_ident.map_fit import MapFit, map_fit
from hand_ident.moves import Move, effect_moves, merged, nominal_moves
from hand_model.effects.effect import Effect

Array = NDArray[np.float64]
MOST = 4
CANDIDATES = 8
"""Effects that are fitted in a round, the best of the screen."""
WORTH_A_FIT = 8.0
"""Cost that a probe must promise to save."""
ACCEPTED = 6.0
"""Log evidence by which an effect must beat the model without it."""
CLAIMABLE = 0.03
CLAIMABLE_FLOOR = 0.6
"""What is worth a claim: the fall of the held-out error relative to itself, and the error that an effect takes away
(the root of the fall of the mean square) relative to the practical floor of repeatability."""
REFINED = 3
"""Hypotheses of a round that are fitted to the end."""


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


@dataclass(slots=True)
class JointSearch:
    """What was found on a joint. rounds: the hypotheses of each round, the most evident first."""

    problem: JointProblem
    nominal: MapFit
    nominal_evidence: float
    accepted: list[Hypothesis] = field(default_factory=list)
    rounds: list[list[Hypothesis]] = field(default_factory=list)
    evidences: list[float] = field(default_factory=list)

    @property
    def final(self) -> MapFit:
        """The fit of the best model."""
        return self.accepted[-1].fit if self.accepted else self.nominal


def search_joint(
    problem: JointProblem,
    effects: Sequence[Effect],
    tolerance: float,
    rested: bool,
    rng: np.random.Generator,
    start: Array | None = None,
) -> JointSearch:
    """Explain one joint by the effects given. tolerance: relative standard deviation of the nominal numbers.

    start: coordinates of the nominal numbers (moves,) from which their fit begins.
    """
    base = nominal_moves(problem.nominal, tolerance, rested)
    nominal = map_fit(problem, base, np.zeros(len(base)) if start is None else start, 8)
    found = JointSearch(problem, nominal, log_evidence(problem, nominal))
    current, evidence = nominal, found.nominal_evidence
    left = list(effects)
    for _ in range(MOST):
        hypotheses = _round(problem, current, left, rng)
        found.rounds.append(hypotheses)
        found.evidences.append(evidence)
        best = next((one for one in hypotheses if _confirmed(problem, current, one)), None)
        if best is not None and not best.fit.residuals:  # only fitted roughly so far
            best = _refine(problem, current, best, rng)
        if best is None or best.log_evidence < evidence + ACCEPTED:
            break
        found.accepted.append(best)
        current, evidence = best.fit, best.log_evidence
        left = [effect for effect in left if effect.name != best.effect.name]
    _prune(found, tolerance, rested)
    found.rounds = [[replace(one, fit=one.fit.lean()) for one in hypotheses] for hypotheses in found.rounds]
    found.accepted[:-1] = [replace(one, fit=one.fit.lean()) for one in found.accepted[:-1]]
    return found


def _round(
    problem: JointProblem, current: MapFit, effects: Sequence[Effect], rng: np.random.Generator
) -> list[Hypothesis]:
    screened = [one for one in screen(problem, current, effects) if one.gain > WORTH_A_FIT][:CANDIDATES]
    hypotheses = [_fit(problem, current, one, rng) for one in screened]
    hypotheses.sort(key=lambda one: -one.log_evidence)
    refined = [_refine(problem, current, one, rng) for one in hypotheses[:REFINED]]
    return sorted(refined + hypotheses[REFINED:], key=lambda one: -one.log_evidence)


def _fit(problem: JointProblem, current: MapFit, screened: Screened, rng: np.random.Generator) -> Hypothesis:
    columns, _ = problem.columns(current.moves, current.z[None])
    added = effect_moves(screened.effect, problem.nominal)
    moves = merged(current.moves, added)
    start = np.array([_start(move, current, screened, columns[0]) for move in moves])
    rough = _judge(problem, current, screened.effect, map_fit(problem, moves, start, 7), rng)
    return replace(rough, fit=rough.fit.lean())


def _refine(problem: JointProblem, current: MapFit, rough: Hypothesis, rng: np.random.Generator) -> Hypothesis:
    """The leading hypotheses fitted to the end."""
    return _judge(problem, current, rough.effect, map_fit(problem, rough.fit.moves, rough.fit.z, 20), rng)


def _judge(problem: JointProblem, current: MapFit, effect: Effect, fit: MapFit, rng: np.random.Generator) -> Hypothesis:
    rmse = held_out_rmse(problem, current.squares), held_out_rmse(problem, fit.squares)
    with np.errstate(invalid="ignore"):
        gain = np.nan_to_num((rmse[0] - rmse[1]) / np.array(FLOOR))
    stage = int(np.argmax(gain))
    fall = block_bootstrap(problem, current.squares, fit.squares, stage, rng)
    return Hypothesis(effect, fit, log_evidence(problem, fit), stage, fall)


def _start(move: Move, current: MapFit, screened: Screened, values: Array) -> float:
    """A probe's value, drawn to the share of it that the screen liked; other coordinates as they are."""
    if move.row in screened.start:
        here = float(values[move.row]) if move.row < len(values) else 0.0
        there = screened.start[move.row]
        share = min(max(screened.share, 0.1), 2.0)
        return move.coordinate(here + share * (there - here) if not _threshold(move) else there)
    if move.row < len(values):
        return move.coordinate(float(values[move.row]))
    return next((float(z) for other, z in zip(current.moves, current.z, strict=True) if other.row == move.row), 0.0)


def _threshold(move: Move) -> bool:
    """A place or a time, which is not scaled with the size of the effect."""
    return move.key.endswith(("angle_deg", "high_deg", "low_deg", "scale_deg")) or (
        move.log and move.key.endswith("_s")
    )


def _confirmed(problem: JointProblem, current: MapFit, hypothesis: Hypothesis) -> bool:
    """Held-out data improve for sure, by something worth saying."""
    before = held_out_rmse(problem, current.squares)[hypothesis.stage]
    after = held_out_rmse(problem, hypothesis.fit.squares)[hypothesis.stage]
    taken = float(np.sqrt(max(before**2 - after**2, 0.0)))
    enough = before - after > CLAIMABLE * before and taken > CLAIMABLE_FLOOR * FLOOR[hypothesis.stage]
    return bool(hypothesis.fall[0] > 0.0 and enough and _worst_improves(problem, current, hypothesis))


def _worst_improves(problem: JointProblem, current: MapFit, hypothesis: Hypothesis) -> bool:
    """The held-out window that was worst gets better, and no window becomes a worse one."""
    counts = problem.block_counts[hypothesis.stage]
    usable = problem.held_out & (counts > 0)
    before = current.squares[hypothesis.stage, usable] / counts[usable]
    after = hypothesis.fit.squares[hypothesis.stage, usable] / counts[usable]
    return bool(len(before) and after[int(np.argmax(before))] < before.max() and after.max() < before.max())


def _prune(found: JointSearch, tolerance: float, rested: bool) -> None:
    """Drop effects that the later ones made superfluous, the least needed first."""
    while len(found.accepted) > 1:
        names = [one.effect.name for one in found.accepted]
        evidence = found.accepted[-1].log_evidence
        trials = []
        for index in range(len(names) - 1):
            kept = [one.effect for k, one in enumerate(found.accepted) if k != index]
            moves = nominal_moves(found.problem.nominal, tolerance, rested)
            for effect in kept:
                moves = merged(moves, effect_moves(effect, found.problem.nominal))
            final = found.final
            start = {move.row: z for move, z in zip(final.moves, final.z, strict=True)}
            fit = map_fit(found.problem, moves, np.array([start.get(move.row, 0.0) for move in moves]), 8)
            trials.append((log_evidence(found.problem, fit), index, fit))
        best = max(trials, key=lambda trial: trial[0])
        if best[0] < evidence - ACCEPTED / 2.0:
            return
        kept_hypotheses = [one for k, one in enumerate(found.accepted) if k != best[1]]
        last = kept_hypotheses[-1]
        kept_hypotheses[-1] = Hypothesis(last.effect, best[2], best[0], last.stage, last.fall)
        found.accepted = kept_hypotheses
