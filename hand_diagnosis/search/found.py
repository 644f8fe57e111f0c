"""What a search found on a joint, and the model without a part of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hand_diagnosis.problem import log_evidence
from hand_diagnosis.search.completion import (
    refit_below_floor,
)
from hand_diagnosis.search.hypotheses import (
    Hypothesis,
    amounts,
)
from hand_diagnosis.settings import SETTINGS
from hand_identification.free_parameters import effect_free_parameters, merged
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, map_fit, start_at
from hand_model.effects.effect import Effect
from hand_model.kernel.rows import ROW


@dataclass(frozen=True, slots=True)
class NotClaimable:
    """An improvement that the validation data confirm and that is too small to be claimed, SI; below: than what."""

    effect: Effect
    stage: int
    taken: float
    floor: float
    below: str


@dataclass(slots=True)
class JointSearch:
    """What was found on a joint. rounds: the hypotheses of each round, the most evident first.

    evidences: log evidence of the model at the beginning of each round.  laws: whether laws are learned.
    begun: the model at the beginning of the first round, where causes of the whole hand were given.
    """

    problem: JointProblem
    nominal: MapFit
    nominal_evidence: float
    laws: bool = True
    accepted: list[Hypothesis] = field(default_factory=list)
    rounds: list[list[Hypothesis]] = field(default_factory=list)
    evidences: list[float] = field(default_factory=list)
    not_claimable: list[NotClaimable] = field(default_factory=list)
    begun: MapFit | None = None

    @property
    def base(self) -> MapFit:
        """The model before any effect of this joint alone."""
        return self.begun or self.nominal

    @property
    def final(self) -> MapFit:
        """The fit of the best model."""
        return self.accepted[-1].fit if self.accepted else self.nominal

    @property
    def effect_keys(self) -> frozenset[str]:
        """Parameters of the effects found; every other one that moved is a nominal number."""
        return frozenset(key for hypothesis in self.accepted for key in hypothesis.keys)

    @property
    def own_rows(self) -> list[int]:
        """Rows of the parameters of the effects of this joint alone, in order; none for causes of the whole hand."""
        return sorted({ROW[key] for found in self.accepted if not found.given for key in found.keys})

    def round_of(self, name: str) -> int:
        """Number of the round in which an effect was accepted: the last one in which it has evidence.

        Raises ValueError where there is none.
        """
        for number in reversed(range(len(self.rounds))):
            evidence = [each.log_evidence for each in self.rounds[number] if each.effect.name == name]
            if evidence and evidence[0] > self.evidences[number]:
                return number
        raise ValueError(f"{name} was accepted in no round")

    def with_effects_off(self, *names: str) -> MapFit:
        """The best model with effects switched off (all, where none is named); its residuals show where they act.

        The nominal model, fitted without the effects, has spread their local error over everything.
        """
        off = [found for found in self.accepted if not names or found.effect.name in names]
        if not off:
            return self.final
        columns, starts = self.problem.columns(self.final.free, self.final.z[None])
        rows = [ROW[key] for found in off for key in found.keys]
        columns[:, rows] = self.problem.nominal[rows]
        residuals = self.problem.residuals(columns, starts)
        squares = self.problem.block_squares(residuals)[0]
        return replace(self.final, squares=squares, residuals=tuple(r[0] for r in residuals), sensitivity=())

    def with_textbook_laws(self) -> JointSearch:
        """The same effects with the textbook forms of their laws, fitted again; what the search went through stays."""
        own = [hypothesis for hypothesis in self.accepted if not hypothesis.given]
        laws = {ROW[key] for hypothesis in own for key in hypothesis.freed}
        start = {p.row: z for p, z in zip(self.final.free, self.final.z, strict=True) if p.row not in laws}
        expected = {p.row: p for each in own for p in effect_free_parameters(each.effect, self.problem.nominal)}
        free = [expected.get(p.row, p) for p in self.final.free if p.row in start]
        for hypothesis in own:
            if hypothesis.textbook is not None:
                start |= {p.row: z for p, z in zip(hypothesis.textbook.free, hypothesis.textbook.z, strict=True)}
        at = np.array([start[p.row] for p in free])
        fit = refit_below_floor(self.problem, map_fit(self.problem, free, at, SETTINGS.law_iterations[1]))
        accepted = [each if each.given else replace(each, freed=(), textbook=None) for each in self.accepted]
        accepted[-1] = replace(accepted[-1], fit=fit)
        return replace(self, accepted=accepted)

    def forget_sensitivities(self) -> None:
        """Drop the large sensitivities; residuals are still needed for figures."""
        self.nominal = self.nominal.without_slopes()
        if self.accepted:
            last = self.accepted[-1]
            self.accepted[-1] = replace(last, fit=last.fit.without_slopes())


def fit_without(found: JointSearch, *left_out: int) -> tuple[float, MapFit]:
    """Log evidence [nats] and fit of the best model without some of its effects, by their places among the accepted."""
    free = list(found.nominal.free)
    for k, hypothesis in enumerate(found.accepted):
        if k not in left_out:
            free = merged(free, hypothesis.free_parameters(found.problem.nominal))
    fit = map_fit(found.problem, free, start_at(free, found.final.by_row), SETTINGS.nominal_iterations)
    return log_evidence(found.problem, fit, amounts(fit)), fit
