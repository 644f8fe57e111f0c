"""Findings: which effect, where, with which probability and numbers; what it could be mistaken for; the verdict.

A finding's numbers and sentence are in the units and words of the hand or machine it is about (hand_model/quantities).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hand_diagnosis.hypotheses import Hypothesis
from hand_diagnosis.search import JointSearch
from hand_diagnosis.settings import SETTINGS
from hand_diagnosis.verdict import Correction, StageResult, Structure, describe, sparse_correction
from hand_identification.joint_problem import BLOCK_S
from hand_identification.map_fit import MapFit
from hand_model.effects.effect import Effect
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_model.quantities import Wording
from hand_recording.signals import Signals

STAGE_PLACES = ("valve", "joint", "force_sensor")
"""Place of an `unknown` finding by the signal in which it shows."""


@dataclass(frozen=True, slots=True)
class Number:
    """One parameter of a finding, with its key, value, standard error and unit on the hand or machine."""

    key: str
    value: float
    std: float
    unit: str
    determined: bool


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding. joint None: the whole hand.  alternatives: (effect, probability, experiment that separates).

    when: stretches of the first recording [s].  numbers: the effect's, or of an `unknown` those of effects that explain
    a part of it.
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


@dataclass(frozen=True, slots=True)
class JointResult:
    """A joint to report on: its search, its signals on the validation data, and the words for it."""

    joint: str
    search: JointSearch
    results: tuple[StageResult, ...]
    wording: Wording

    def rmse(self, fit: MapFit, stage: int) -> float:
        """Validation error of a fit in the unit in which the signal is shown."""
        held = self.search.problem.held_out
        count = max(float(self.search.problem.block_counts[stage, held].sum()), 1.0)
        return self.wording.signal_units[stage][0] * float(np.sqrt(fit.squares[stage, held].sum() / count))


def ranked_findings(joints: Sequence[JointResult], signals: Sequence[Signals]) -> list[Finding]:
    """Dropped frames first, then the findings of every joint by how much they explain; one of the hand only once."""
    scored: list[tuple[float, Finding]] = []
    for result in joints:
        gain, weight = result.search.nominal.cost - result.search.final.cost, result.search.final.cost
        worst = max(result.results, key=lambda r: r.excess_after * r.unexplained, default=None)
        if worst is not None and worst.unexplained:
            scored.append((gain + weight, unknown_finding(result, worst)))
            continue
        scored += [(gain / (order + 1.0), finding) for order, finding in enumerate(joint_findings(result))]
    scored.sort(key=lambda pair: -pair[0])
    unique = _dropped_frames(signals)
    for _, finding in scored:
        if finding.joint is None and any(f.joint is None and f.effect == finding.effect for f in unique):
            continue
        unique.append(finding)
    return unique


def verdict(findings: Sequence[Finding], joints: Sequence[JointResult]) -> str:
    """agrees, explained, partly_explained or unknown_physics."""
    names = {finding.effect for finding in findings}
    if not names:
        return "agrees"
    if "unknown" in names:
        return "unknown_physics" if names <= {"unknown", "dropped_frames"} else "partly_explained"
    left = any(stage.leftover for joint in joints for stage in joint.results if joint.search.accepted)
    return "partly_explained" if left else "explained"


def _dropped_frames(signals: Sequence[Signals]) -> list[Finding]:
    """Missing frames, as the time stamps show them."""
    found = []
    for recording in signals:
        share = max(recording.dropped, _lost(recording))
        if share > SETTINGS.max_dropped_share:
            statement = f"{recording.name}: {share:.2%} of the frames are missing; gaps are bridged and not used."
            probability = SETTINGS.dropped_frames_probability
            where = ("stamps", "gaps between stamps")
            found.append(Finding(None, "timing", "dropped_frames", probability, (), (), *where, (), statement))
    return found


def _lost(recording: Signals) -> float:
    """Share of samples without any reading between the first and the last; topics need not begin or end together."""
    read = np.flatnonzero(recording.known.any(axis=1))
    return 1.0 - len(read) / (read[-1] - read[0] + 1) if len(read) else 0.0


def joint_findings(result: JointResult) -> list[Finding]:
    """A finding for every accepted effect of a joint."""
    return [_finding(result, index) for index in range(len(result.search.accepted))]


def _finding(result: JointResult, index: int) -> Finding:
    """The finding of the accepted effect of that index."""
    search, wording = result.search, result.wording
    accepted = search.accepted[index]
    effect, stage = accepted.effect, accepted.stage
    rivals = _rivals(search, accepted)
    alternatives = _alternatives(effect, rivals)
    numbers = tuple(parameter_numbers(search, effect, wording))
    off = search.with_effects_off(effect.name)
    before = search.nominal if index == 0 else search.accepted[index - 1].fit
    low = SETTINGS.min_probability
    return Finding(
        None if effect.everywhere or effect.place == "supply" else result.joint,
        effect.place,
        effect.name,
        min(max(rivals[effect.name][1], low), 1.0 - low),
        alternatives,
        _when(search, off, stage),
        wording.signals[stage],
        _condition(search, off, stage, wording),
        numbers,
        _statement(result, index, said(effect, numbers, wording), before, alternatives),
    )


def _statement(
    result: JointResult, index: int, says: str, before: MapFit, alternatives: Sequence[tuple[str, float, str]]
) -> str:
    """The sentence of a finding. before: the model without the effect."""
    accepted = result.search.accepted[index]
    stage = accepted.stage
    noise = next(r.noise for r in result.results if r.stage == stage)
    factor, unit = result.wording.signal_units[stage]
    fall = f"{result.rmse(before, stage):.3g} to {result.rmse(accepted.fit, stage):.3g} {unit}"
    text = (
        f"{result.joint}: {says}. The validation error of the {result.wording.signals[stage]} falls from {fall};"
        f" the noise floor is {factor * noise:.3g} {unit}."
    )
    if alternatives:
        name, probability, experiment = alternatives[0]
        text += f" The alternative is {name} ({probability:.0%}); the experiment {experiment} separates them."
    return text


def _rivals(search: JointSearch, accepted: Hypothesis) -> dict[str, tuple[Effect, float]]:
    """Effects and probabilities of the round in which the effect was accepted, the model without it included."""
    share = SETTINGS.several_effects_factor if len(search.accepted) > 1 else 1.0
    for hypotheses, without in reversed(list(zip(search.rounds, search.evidences, strict=True))):
        names = [hypothesis.effect.name for hypothesis in hypotheses]
        if accepted.effect.name in names and hypotheses[names.index(accepted.effect.name)].log_evidence > without:
            logs = np.array([hypothesis.log_evidence for hypothesis in hypotheses] + [without])
            weights = np.exp((logs - logs.max()) / SETTINGS.evidence_temperature)
            weights *= (1.0 - SETTINGS.outside_catalogue) / weights.sum()
            return {h.effect.name: (h.effect, share * float(w)) for h, w in zip(hypotheses, weights, strict=False)}
    return {accepted.effect.name: (accepted.effect, share * SETTINGS.sole_probability)}


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


def said(effect: Effect, numbers: Sequence[Number], wording: Wording) -> str:
    """The catalogue's sentence about an effect, with its numbers and their units."""
    keys = {wording.units.quantity(key).key: key for key in effect.keys}
    return wording.sentence(effect.says, [(keys[n.key], n.value, n.std) for n in numbers if n.key in keys])


def parameter_numbers(search: JointSearch, effect: Effect, wording: Wording) -> list[Number]:
    """The effect's parameters in the final fit with standard errors, in the units of the hand or machine."""
    fit = search.final
    columns, _ = search.problem.columns(fit.free, fit.z[None])
    deviation = np.sqrt(np.diag(fit.covariance))
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


def _when(search: JointSearch, off: MapFit, stage: int) -> tuple[tuple[float, float], ...]:
    """Stretches [s] of the first recording in which the model without the effect clearly misses."""
    segment = search.problem.segments[0]
    count = search.problem.block_counts[stage]
    rms = np.sqrt(off.squares[stage] / np.maximum(count, 1))
    blocks = np.unique(segment.block)
    level = max(0.5 * float(rms[blocks].max(initial=0.0)), 1e-300)
    spans: list[tuple[float, float]] = []
    for block in blocks[rms[blocks] > level]:
        inside = np.flatnonzero(segment.block == block)
        start, end = inside[0] * segment.period_s, (inside[-1] + 1) * segment.period_s
        if spans and start - spans[-1][1] < 0.5 * BLOCK_S:
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


def unknown_finding(result: JointResult, stage: StageResult) -> Finding:
    """A residual that no effect explains; numbers: of effects that explain a part of it."""
    search, wording = result.search, result.wording
    structure = describe(search.problem, search.final, stage.stage)
    held = [accepted.effect for accepted in search.accepted]
    own = [parameter_numbers(search, effect, wording) for effect in held]
    first_round = [hypothesis.effect for hypothesis in search.rounds[0]] if search.rounds else []
    near = list({effect.name: effect for effect in [*held, *first_round]}.values())[:2]
    # What is named here is what the unknown is not; the first is twice as probable as the second.
    other = 1.0 - SETTINGS.unknown_probability
    names = [(effect.name, other * (2 - k) / 3, effect.experiments[0]) for k, effect in enumerate(near)]
    parts = [said(effect, numbers, wording) for effect, numbers in zip(held, own, strict=True)]
    correction = sparse_correction(search.problem, search.final, stage.stage, wording)
    return Finding(
        result.joint,
        STAGE_PLACES[stage.stage],
        "unknown",
        SETTINGS.unknown_probability,
        tuple(names),
        _when(search, search.nominal, stage.stage),
        wording.signals[stage.stage],
        f"depends most on the {wording.state(structure.state)}",
        tuple(number for numbers in own for number in numbers),
        unknown_statement(result, stage, structure, parts, correction),
    )


def unknown_statement(
    result: JointResult, stage: StageResult, structure: Structure, parts: Sequence[str], correction: Correction
) -> str:
    """The sentences of an `unknown`. parts: the catalogue's sentences about effects that explain a part."""
    wording = result.wording
    factor, unit = wording.signal_units[stage.stage]
    slow = structure.frequency_hz < SETTINGS.slow_hz
    pace = "varies slowly" if slow else f"has its spectrum around {structure.frequency_hz:.1f} Hz"
    held = ""
    if parts:
        errors = f"{factor * stage.before:.3g} to {factor * stage.after:.3g} {unit}"
        held = (
            f" A part of it may be explained: {'; '.join(parts)}; with that the validation error falls from {errors}."
        )
    (_, angle), (_, pressure) = wording.symbol_units
    position, drive, speed = wording.symbols
    return (
        f"{result.joint}: a residual of the {wording.signals[stage.stage]} of {factor * stage.excess_after:.3g} {unit}"
        f" RMS on the validation data exceeds the noise, and no effect of the catalogue explains it. It depends most on"
        f" the {wording.state(structure.state)} ({structure.share:.0%} of its variance), {pace}, and differs by"
        f" {factor * structure.direction:.2g} {unit} between {wording.positive} and {wording.negative}.{held}"
        f" A data-driven correction without physical meaning, {correction.text} {unit} ({position} in {angle}, {drive}"
        f" in {pressure}, {speed} in {angle}/s), removes {correction.validation_share:.0%} of its mean square on the"
        f" validation data."
    )
