"""Findings: which effect, where, how sure, with what numbers; and what it could be mistaken for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hand_diagnosis.correction import Correction
from hand_diagnosis.search import Hypothesis, JointSearch
from hand_diagnosis.verdict import StageResult, Structure
from hand_identification.joint_problem import BLOCK_S, SHOWN, STAGES, UNITS
from hand_identification.map_fit import MapFit
from hand_model.effects.effect import Effect
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_model.quantities import HAND

TEMPERATURE = 1.25
"""Log evidences are divided by it: equations that are only nearly right make differences look larger than they are."""
OUTSIDE = 0.04
"""Share kept for physics that the catalogue does not hold and that the named effect stands in for."""
SEVERAL = 0.85
"""Share by which each of several effects of one joint is less probable: two can conspire to be a third, left out."""
UNKNOWN = 0.94
"""Probability of an `unknown`: how often it was right in trials with concealed effects, like OUTSIDE."""
MENTIONED = 0.02
"""Alternatives less probable than this are left out."""


@dataclass(frozen=True, slots=True)
class Number:
    """One parameter of a finding, in the unit of its key."""

    key: str
    value: float
    std: float
    unit: str
    determined: bool


@dataclass(frozen=True, slots=True)
class Unexplained:
    """What is left, its size and its difference between the directions of motion in `unit`."""

    size: float
    unit: str
    structure: Structure
    direction: float
    correction: Correction


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding. joint None: the whole hand.  alternatives: (effect, probability, experiment that separates).

    numbers: the effect's, or of an `unknown` those of effects that explain a part of it.
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
    unexplained: Unexplained | None = None


def unit_of(key: str) -> str:
    """The unit that a key's name ends in."""
    return HAND.units.quantity(key).unit


def joint_findings(joint: str, search: JointSearch, results: Sequence[StageResult]) -> list[Finding]:
    """A finding for every accepted effect of a joint."""
    found = []
    for index, accepted in enumerate(search.accepted):
        noise = next(result.noise for result in results if result.stage == accepted.stage)
        found.append(_finding(joint, search, accepted, noise, index))
    return found


def unknown_finding(
    joint: str, search: JointSearch, result: StageResult, structure: Structure, correction: Correction
) -> Finding:
    """Something is there that no effect explains; numbers: of effects that explain a part of it."""
    scale = SHOWN[result.stage]
    rest = Unexplained(
        scale * result.excess_after, UNITS[result.stage], structure, scale * structure.direction, correction
    )
    held = [accepted.effect for accepted in search.accepted]
    own = [parameter_numbers(search, effect) for effect in held]
    near = list({one.name: one for one in [*held, *(one.effect for one in _first_round(search))]}.values())[:2]
    # Twice as probable as the other; what is named here is what the unknown is not.
    names = [(e.name, (1.0 - UNKNOWN) * (2 - k) / 3.0, e.experiments[0]) for k, e in enumerate(near)]
    place = "valve" if result.stage == 0 else "force_sensor" if result.stage == 2 else "joint"
    errors = f"{scale * result.before:.3g} to {scale * result.after:.3g} {UNITS[result.stage]}"
    parts = [said(effect, numbers) for effect, numbers in zip(held, own, strict=True)]
    statement = unknown_statement(joint, rest, parts, errors)
    return Finding(
        joint, place, "unknown", UNKNOWN, tuple(names), _when(search, search.nominal, result.stage), structure.signal,
        f"mostly with {structure.state}", tuple(number for numbers in own for number in numbers), statement, rest,
    )  # fmt: skip


def said(effect: Effect, numbers: Sequence[Number]) -> str:
    """The catalogue's sentence about an effect, with its numbers and their units."""
    return HAND.sentence(effect.says, [(n.key, n.value, n.std) for n in numbers])


def unknown_statement(joint: str, rest: Unexplained, parts: Sequence[str], errors: str) -> str:
    """In words. parts: what the catalogue says of effects that explain a part.  errors: before and after them."""
    structure, unit = rest.structure, rest.unit
    memory = "changes slowly" if structure.frequency_hz < 0.2 else f"around {structure.frequency_hz:.1f} Hz"
    held = f" A part of it may be: {'; '.join(parts)}; with that the error falls from {errors}." if parts else ""
    return (
        f"{joint}: {rest.size:.3g} {unit} RMS of the {structure.signal} on held-out data is more than noise and fits no"
        f" effect of the catalogue; it depends most on {structure.state}"
        f" ({structure.share:.0%} of its variance), {memory},"
        f" and differs by {rest.direction:.2g} {unit} between flexing and extending.{held}"
        f" Data-driven correction, no physics: {rest.correction.text} {unit}, which takes away"
        f" {rest.correction.held_out_share:.0%} of it on held-out data."
    )


def _first_round(search: JointSearch) -> list[Hypothesis]:
    return search.rounds[0] if search.rounds else []


def _rivals(search: JointSearch, accepted: Hypothesis) -> list[tuple[Effect, float]]:
    """Effects and probabilities of the round in which the effect was accepted, the model without it included."""
    for hypotheses, without in reversed(list(zip(search.rounds, search.evidences, strict=True))):
        names = [one.effect.name for one in hypotheses]
        if accepted.effect.name in names and hypotheses[names.index(accepted.effect.name)].log_evidence > without:
            logs = np.array([one.log_evidence for one in hypotheses] + [without])
            weights = np.exp((logs - logs.max()) / TEMPERATURE)
            weights *= (1.0 - OUTSIDE) / weights.sum()
            return [(one.effect, float(w)) for one, w in zip(hypotheses, weights, strict=False)]
    return [(accepted.effect, 0.9)]


def _finding(joint: str, search: JointSearch, accepted: Hypothesis, noise: float, index: int) -> Finding:
    """noise: of the stage that gains most, SI.  index: of the effect among those accepted."""
    effect, share = accepted.effect, SEVERAL if len(search.accepted) > 1 else 1.0
    rivals = [(one, share * p) for one, p in _rivals(search, accepted)]
    probability = next(p for e, p in rivals if e.name == effect.name)
    others = [(e, p) for e, p in rivals if e.name != effect.name and p > MENTIONED]
    alternatives = tuple((e.name, p, _separating(effect, e)) for e, p in sorted(others, key=lambda pair: -pair[1]))
    numbers = tuple(parameter_numbers(search, effect))
    stage, bare = accepted.stage, search.with_effects_off(effect.name)
    before = search.nominal if index == 0 else search.accepted[index - 1].fit
    fall = _fall(search, before, accepted.fit, stage)
    says = said(effect, numbers)
    floor = f"{SHOWN[stage] * noise:.3g} {UNITS[stage]}"
    statement = f"{joint}: {says}. The held-out error of the {STAGES[stage]} falls from {fall}; the noise is {floor}."
    if alternatives:
        statement += (
            f" It could also be {alternatives[0][0]} ({alternatives[0][1]:.0%}); {alternatives[0][2]} would tell."
        )
    return Finding(
        None if effect.everywhere or effect.place == "supply" else joint,
        effect.place,
        effect.name,
        min(max(probability, 0.01), 0.99),
        alternatives,
        _when(search, bare, stage),
        STAGES[stage],
        _condition(search, bare, stage),
        numbers,
        statement,
    )


def _separating(one: Effect, other: Effect) -> str:
    """An experiment that shows the one better than the other, by what the catalogue says of both."""
    own = [name for name in one.experiments if name not in other.experiments]
    theirs = [name for name in other.experiments if name not in one.experiments]
    return (own or theirs or list(one.experiments) or ["slow_triangle"])[0]


def parameter_numbers(search: JointSearch, effect: Effect) -> list[Number]:
    """The effect's parameters in the final fit with standard errors, in the units of their keys."""
    fit = search.final
    columns, _ = search.problem.columns(fit.free, fit.z[None])
    deviation = np.sqrt(np.diag(fit.covariance))
    numbers = []
    for key in effect.keys:
        row, scale = ROW[key], JOINT_PARAMETERS[ROW[key]].scale
        index = next((k for k, parameter in enumerate(fit.free) if parameter.row == row), None)
        if index is None:
            continue
        parameter, value = fit.free[index], float(columns[0, row])
        std = (abs(value) * parameter.scale if parameter.log else parameter.scale) * float(deviation[index])
        numbers.append(Number(key, value / scale, std / scale, unit_of(key), bool(deviation[index] < 0.5)))
    return numbers


def _fall(search: JointSearch, before: MapFit, after: MapFit, stage: int) -> str:
    held = search.problem.held_out
    counts = max(float(search.problem.block_counts[stage, held].sum()), 1.0)
    errors = [SHOWN[stage] * float(np.sqrt(fit.squares[stage, held].sum() / counts)) for fit in (before, after)]
    return f"{errors[0]:.3g} to {errors[1]:.3g} {UNITS[stage]}"


def _when(search: JointSearch, bare: MapFit, stage: int) -> tuple[tuple[float, float], ...]:
    """Stretches of the first recording in which the model without the effect misses clearly, [s]."""
    segment = search.problem.segments[0]
    count = search.problem.block_counts[stage]
    rms = np.sqrt(bare.squares[stage] / np.maximum(count, 1))
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


def _condition(search: JointSearch, bare: MapFit, stage: int) -> str:
    from hand_diagnosis.verdict import describe  # noqa: PLC0415 - verdict and findings look at each other's words

    structure = describe(search.problem, bare, stage)
    low = "below" if structure.direction < 0 else "above"
    return (
        f"varies most with {structure.state} ({structure.share:.0%} of the residual's variance); while flexing"
        f" {abs(SHOWN[stage] * structure.direction):.2g} {UNITS[stage]} {low} extending"
    )
