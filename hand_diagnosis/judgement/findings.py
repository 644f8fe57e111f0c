"""Findings: which effect, where, with which probability and numbers, which share it explains, and its rivals.

A finding's numbers and sentence are in the units and words of the hand or machine it is about (hand_model/quantities).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hand_diagnosis.judgement.onset import Onset
from hand_diagnosis.judgement.residual_structure import describe
from hand_diagnosis.judgement.stage_errors import StageResult
from hand_diagnosis.judgement.statement import Number, said
from hand_diagnosis.problem import ErrorsOnTest
from hand_diagnosis.search import Hypothesis, JointSearch, LawCurve, standard_errors
from hand_diagnosis.search import describe as describe_law
from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit
from hand_identification.settings import FITS
from hand_model.effects import EFFECTS
from hand_model.effects.effect import Effect
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_model.quantities import Wording
from hand_recording.signals import Signals


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One finding. joint None: the whole hand.  alternatives: (effect, probability, experiment that separates).

    when: stretches of the first recording [s].  numbers: the effect's.  tied_with: effects that the data cannot
    separate from it.  explains: share of the signal's mean square beyond the noise that it removes, 0 ... 1.
    at_bound: keys of its numbers that ended at a bound of their range.  law: its constitutive law; None for a class
    that is a single number.  onset: when it begins or ends; None where it is there all the time.
    """

    joint: str | None
    place: str
    effect: str
    probability: float
    alternatives: tuple[tuple[str, float, str], ...]
    when: tuple[tuple[float, float], ...]
    signal: str
    condition: str
    numbers: tuple[Number, ...]
    statement: str
    tied_with: tuple[str, ...] = ()
    explains: float = 1.0
    at_bound: tuple[str, ...] = ()
    law: LawCurve | None = None
    onset: Onset | None = None


@dataclass(frozen=True, slots=True)
class JointResult:
    """A joint to report on: its search, its signals on the validation data, and the words for it.

    test: errors of the nominal model and of the final one on the test data; None where there are none.
    onset: when its effects begin or end; None where they are there all the time.  whole: the problem with the test
    data, which the search did not see.  last: the search with its models fitted to more data, when all choices were
    made, for the numbers that are reported; None: those of the search are.
    """

    joint: str
    search: JointSearch
    results: tuple[StageResult, ...]
    wording: Wording
    test: ErrorsOnTest | None = None
    onset: Onset | None = None
    whole: JointProblem | None = None
    last: JointSearch | None = None

    @property
    def reported(self) -> JointSearch:
        """The search whose numbers are reported."""
        return self.last or self.search

    def result(self, stage: int) -> StageResult:
        """The result of a signal that the joint has."""
        return next(result for result in self.results if result.stage == stage)

    def claimed(self) -> list[int]:
        """Places, among the accepted effects, of those that are findings."""
        accepted = self.search.accepted
        return [k for k, found in enumerate(accepted) if self.result(found.stage).claimed]

    def rmse(self, fit: MapFit, stage: int) -> float:
        """Validation error of a fit [unit in which the signal is shown]."""
        held = self.search.problem.validation
        count = max(float(self.search.problem.block_counts[stage, held].sum()), 1.0)
        return self.wording.signal_units[stage][0] * float(np.sqrt(fit.squares[stage, held].sum() / count))


def ranked_findings(joints: Sequence[JointResult], signals: Sequence[Signals]) -> list[Finding]:
    """The findings of every joint by how much they explain, one of the hand only once; missing frames last.

    What is hardly sure counts the less, so that no guess about one joint comes before a sure finding on another. Frames
    that are missing are bridged and explain nothing of what the others show.
    """
    scored: list[tuple[float, Finding]] = []
    for result in joints:
        gain = result.search.nominal.cost - result.search.final.cost
        found = joint_findings(result)
        scored += [(_sure(each) * gain / (order + 1.0), each) for order, each in enumerate(found)]
    scored.sort(key=lambda pair: -pair[0])
    unique: list[Finding] = []
    for _, finding in scored:
        if finding.joint is None and any(f.joint is None and f.effect == finding.effect for f in unique):
            continue
        unique.append(finding)
    return unique + _dropped_frames(signals)


def _sure(finding: Finding) -> float:
    """Probability, 0 ... 1, of the finding or of one of those that tie with it."""
    tied = (probability for name, probability, _ in finding.alternatives if name in finding.tied_with)
    return finding.probability + sum(tied)


def _dropped_frames(signals: Sequence[Signals]) -> list[Finding]:
    """Missing frames, as the time stamps show them."""
    found = []
    for recording in signals:
        share = max(recording.dropped, _lost(recording))
        if share > SETTINGS.max_dropped_share:
            statement = f"{recording.name}: {share:.2%} of the frames are missing; gaps are bridged and not used."
            probability = SETTINGS.dropped_frames_probability
            found.append(
                Finding(
                    joint=None,
                    place="timing",
                    effect="dropped_frames",
                    probability=probability,
                    alternatives=(),
                    when=(),
                    signal="stamps",
                    condition="gaps between stamps",
                    numbers=(),
                    statement=statement,
                )
            )
    return found


def _lost(recording: Signals) -> float:
    """Share of samples without any reading between the first and the last; topics need not begin or end together."""
    read = np.flatnonzero(recording.known.any(axis=1))
    return 1.0 - len(read) / (read[-1] - read[0] + 1) if len(read) else 0.0


def joint_findings(result: JointResult) -> list[Finding]:
    """A finding for every accepted effect of a joint that is claimed.

    In the order of acceptance, but for those of one signal, see `in_order`.
    """
    return in_order([_finding(result, index) for index in result.claimed()])


def in_order(found: Sequence[Finding]) -> list[Finding]:
    """Findings of a joint; of those of one signal the largest comes first, and a finer form after what it refines."""
    ranked = list(found)
    for signal in {finding.signal for finding in found}:
        own = [finding for finding in found if finding.signal == signal]
        names = {finding.effect for finding in own}
        own.sort(key=lambda each: (not names.isdisjoint(EFFECTS[each.effect].refines), -each.explains))
        places = [k for k, finding in enumerate(found) if finding.signal == signal]
        for k, finding in zip(places, own, strict=True):
            ranked[k] = finding
    return ranked


def _finding(result: JointResult, index: int) -> Finding:
    """The finding of the accepted effect of that index."""
    search, wording = result.search, result.wording
    accepted = search.accepted[index]
    effect, stage = accepted.effect, accepted.stage
    rivals, tied = _rivals(search, accepted)
    # What is left on data that were not fitted speaks against the effect itself, too: another may stand behind it.
    sure = result.result(stage).right_name
    alternatives = _alternatives(effect, {name: (e, sure * p) for name, (e, p) in rivals.items()})
    numbers = tuple(parameter_numbers(result.reported, effect, wording))
    off = search.with_effects_off(effect.name)
    low = SETTINGS.min_probability
    probability = min(max(sure * rivals[effect.name][1], low), 1.0 - low)
    bound = _at_bounds(result.reported, effect, wording)
    law = law_curve(result.reported, result.reported.accepted[index], wording)
    explains = _explained_by(result, index)
    return Finding(
        joint=None if effect.of_the_hand else result.joint,
        place=effect.place,
        effect=effect.name,
        probability=probability,
        alternatives=alternatives,
        when=when(search, off, stage),
        signal=wording.signals[stage],
        condition=_condition(search, off, stage, wording),
        numbers=numbers,
        statement=_statement(result, index, said(effect, numbers, wording), tied, explains, bound, law),
        tied_with=tuple(tied),
        explains=explains,
        at_bound=tuple(key for key, _ in bound),
        law=law,
        onset=result.onset,
    )


def law_curve(search: JointSearch, accepted: Hypothesis, wording: Wording) -> LawCurve | None:
    """The law of an accepted effect in the final fit; None for a class without coefficients."""
    if not accepted.effect.coefficients:
        return None
    return describe_law(search.problem, accepted.effect, search.final, accepted.textbook, wording)


def _explained_by(result: JointResult, index: int) -> float:
    """Share of a signal's mean square beyond the noise that an effect explains; several divide it by what each adds."""
    search, stage = result.search, result.search.accepted[index].stage
    alike = [found.effect.name for found in search.accepted if found.stage == stage]
    explained = result.result(stage).explained
    if len(alike) == 1:
        return explained
    final = result.rmse(search.final, stage) ** 2
    added = {name: max(result.rmse(search.with_effects_off(name), stage) ** 2 - final, 1e-300) for name in alike}
    return explained * added[search.accepted[index].effect.name] / sum(added.values())


def _at_bounds(search: JointSearch, effect: Effect, wording: Wording) -> list[tuple[str, str]]:
    """Numbers of an effect that ended at a bound of their allowed range: key, and the bound with its unit."""
    fit = search.final
    columns, _ = search.problem.columns(fit.free, fit.z[None])
    found = []
    for parameter in fit.free:
        if parameter.row >= len(ROW) or parameter.key not in effect.keys:
            continue
        known = JOINT_PARAMETERS[parameter.row]
        value = float(columns[0, parameter.row]) / known.scale
        neutral = known.neutral
        for bound in (known.low, known.high):
            if abs(value - bound) <= SETTINGS.bound_margin * abs(bound) and bound != neutral:
                own = wording.units.quantity(parameter.key)
                found.append((own.key, f"{own.factor * bound:.3g}" + ("" if own.unit == "1" else f" {own.unit}")))
    return found


def _statement(
    result: JointResult,
    index: int,
    says: str,
    tied: Sequence[str],
    explains: float,
    bound: Sequence[tuple[str, str]],
    law: LawCurve | None,
) -> str:
    """The sentences of a finding."""
    accepted = result.search.accepted[index]
    stage = accepted.stage
    signal, (factor, unit) = result.wording.signals[stage], result.wording.signal_units[stage]
    names = " or ".join([accepted.effect.name, *tied])
    where, explained = result.joint, "It explains"
    if accepted.given and accepted.effect.of_the_hand:
        where, explained = result.wording.whole, f"Its numbers fit all joints at once. On {result.joint}, it explains"
    text = f"{where}: {says}."
    if tied:
        text = f"{where}: these data do not separate {names}. If it is {accepted.effect.name}, {says}."
    if law is not None and law.form == "learned":
        text += f" Its law departs from the textbook form: {law.statement}."
    text += f" {explained} {explains:.0%} of the mismatch of the {signal}. {errors_text(result, stage)}"
    text += f" The noise floor is {factor * result.result(stage).noise:.3g} {unit}."
    if result.onset is not None:
        text += f" {result.onset.statement}"
    for key, limit in bound:
        text += f" {key} ended at the limit of its allowed range, {limit}; the true value may lie beyond it."
    return text


def errors_text(result: JointResult, stage: int) -> str:
    """The sentence about the error before and after on test data; on validation data where there are none."""
    signal, (factor, unit) = result.wording.signals[stage], result.wording.signal_units[stage]
    if result.test is not None and np.isfinite(result.test.rmse(0)[stage]):
        before, after = (factor * float(result.test.rmse(k)[stage]) for k in (0, 1))
        moves = "falls" if after < before else "changes"
        return f"The test error of the {signal} {moves} from {before:.3g} to {after:.3g} {unit}."
    own = result.result(stage)
    return (
        f"The validation error of the {signal} falls from {factor * own.before:.3g} to {factor * own.after:.3g} {unit};"
        " the recording is too short for test data."
    )


def _rivals(search: JointSearch, accepted: Hypothesis) -> tuple[dict[str, tuple[Effect, float]], list[str]]:
    """Effects and probabilities of the round in which the effect was accepted, and those that tie with it.

    The model without a further effect competes, too. What is left on data that were not fitted, and may come from
    effects that no catalogue holds, is weighed by the caller.
    """
    name = accepted.effect.name
    place = search.round_of(name)
    hypotheses, without = search.rounds[place], search.evidences[place]
    own = next(hypothesis for hypothesis in hypotheses if hypothesis.effect.name == name)
    logs = np.array([hypothesis.log_evidence for hypothesis in hypotheses] + [without])
    weights = np.exp((logs - logs.max()) / SETTINGS.evidence_temperature)
    weights *= (1.0 - SETTINGS.min_probability) / weights.sum()
    near = own.log_evidence - SETTINGS.tie_log_evidence
    later = {found.effect.name for found in search.accepted}
    tied = [h.effect.name for h in hypotheses if h.log_evidence > max(near, without) and h.effect.name not in later]
    return {h.effect.name: (h.effect, float(w)) for h, w in zip(hypotheses, weights, strict=False)}, tied


def _alternatives(effect: Effect, rivals: dict[str, tuple[Effect, float]]) -> tuple[tuple[str, float, str], ...]:
    """The other effects, the most probable first, each with an experiment that separates it from this one."""
    others = [pair for name, pair in rivals.items() if name != effect.name and pair[1] > SETTINGS.min_alternative]
    others.sort(key=lambda pair: -pair[1])
    return tuple((other.name, probability, _separating(effect, other)) for other, probability in others)


def _separating(effect: Effect, other: Effect) -> str:
    """An experiment that shows one of two effects better than the other, by what the catalogue says of both."""
    own = [name for name in effect.experiments if name not in other.experiments]
    theirs = [name for name in other.experiments if name not in effect.experiments]
    return (own or theirs or list(effect.experiments) or ["slow_triangle"])[0]


def parameter_numbers(search: JointSearch, effect: Effect, wording: Wording) -> list[Number]:
    """The effect's parameters in the final fit with standard errors, in the units of the hand or machine."""
    fit = search.final
    columns, _ = search.problem.columns(fit.free, fit.z[None])
    deviation = standard_errors(search.problem, fit)
    index = {parameter.row: k for k, parameter in enumerate(fit.free)}
    numbers = []
    for key in effect.keys:
        row = ROW[key]
        if row not in index:
            continue
        own = wording.units.quantity(key)
        factor = own.factor / JOINT_PARAMETERS[row].scale
        parameter, value, error = fit.free[index[row]], float(columns[0, row]), float(deviation[index[row]])
        std = (abs(value) * parameter.scale if parameter.log else parameter.scale) * error
        determined = error < SETTINGS.determined_deviation
        numbers.append(Number(own.key, factor * value, factor * std, own.unit, determined))
    return numbers


def when(search: JointSearch, off: MapFit, stage: int) -> tuple[tuple[float, float], ...]:
    """Stretches [s] of the first recording in which the model without the effect clearly misses."""
    segment = search.problem.segments[0]
    count = search.problem.block_counts[stage]
    rms = np.sqrt(off.squares[stage] / np.maximum(count, 1))
    blocks = np.unique(segment.block)
    level = max(SETTINGS.missed_share * float(rms[blocks].max(initial=0.0)), 1e-300)
    spans: list[tuple[float, float]] = []
    for block in blocks[rms[blocks] > level]:
        inside = np.flatnonzero(segment.block == block)
        start, end = inside[0] * segment.period_s, (inside[-1] + 1) * segment.period_s
        if spans and start - spans[-1][1] < SETTINGS.missed_gap_blocks * FITS.block_s:
            spans[-1] = (spans[-1][0], float(end))
        else:
            spans.append((float(start), float(end)))
    return tuple((round(a, 2), round(b, 2)) for a, b in spans)


def _condition(search: JointSearch, off: MapFit, stage: int, wording: Wording) -> str:
    structure = describe(search.problem, off, stage)
    low = "below" if structure.direction < 0 else "above"
    factor, unit = wording.signal_units[stage]
    return (
        f"depends most on the {wording.state(structure.state)} ({structure.share:.0%} of the residual's variance);"
        f" while {wording.positive} it is {abs(factor * structure.direction):.2g} {unit} {low} its value while"
        f" {wording.negative}"
    )
