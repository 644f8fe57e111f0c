"""Remainders: what the model leaves beyond the findings, its own probability of being other physics, and its law.

The probability is that of verdict.StageResult.other_physics. Numbers and sentences are in the units and words of the
hand or machine they are about (hand_model/quantities).

A remainder gets a law without a name where the data confirm one (remainder_law.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hand_diagnosis.judgement.findings import Finding, JointResult, errors_text, parameter_numbers, when
from hand_diagnosis.judgement.remainder_law import FAMILIES, PERIODIC, RemainderLaw, described, learn_remainder
from hand_diagnosis.judgement.residual_structure import Structure, describe, describe_test
from hand_diagnosis.judgement.stage_errors import StageResult
from hand_diagnosis.judgement.statement import Number, said
from hand_diagnosis.problem import stretch_of_test, swings_freely
from hand_diagnosis.search import LawCurve
from hand_diagnosis.settings import SETTINGS

STAGE_PLACES = ("valve", "joint", "force_sensor")
"""Place of a remainder by the signal in which it shows."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Remainder:
    """What the best model leaves of a signal of a joint, in the unit in which the signal is shown.

    rms: beyond the noise.  share: of the mean square beyond the noise, 0 ... 1.  split: the data on which most is left.
    probability: of being other physics than that named.  candidates: effects that explain a part and are not claimed,
    with their numbers.  learned, law: the law that the data confirm, as a fit and as a curve; None where none is.
    """

    joint: str
    place: str
    signal: str
    rms: float
    unit: str
    share: float
    probability: float
    family: str
    when: tuple[tuple[float, float], ...]
    candidates: tuple[tuple[str, tuple[Number, ...]], ...]
    statement: str
    split: str = "validation"
    learned: RemainderLaw | None = None
    law: LawCurve | None = None

    def law_document(self) -> dict[str, Any] | None:
        """The entry `law` in report.json: the curve, the effect that carries it, and its errors [SI]."""
        if self.law is None or self.learned is None:
            return None
        gain = {"validation": self.learned.validation, "test": self.learned.test}
        errors = {split: None if pair is None else list(pair) for split, pair in gain.items()}
        return {**self.law.document(), "effect": self.learned.placed.effect.name, "errors_si": errors}


def remainders(joints: Sequence[JointResult]) -> list[Remainder]:
    """What is more probably other physics than not, the largest in noise floors first."""
    left = [(result, stage) for result in joints for stage in result.results if stage.remains]
    left.sort(key=lambda pair: -pair[1].most_left.after / pair[1].floor)
    return [remainder(result, stage) for result, stage in left]


def verdict(findings: Sequence[Finding], left: Sequence[Remainder], joints: int) -> str:
    """agrees, explained, partly_explained or unknown_physics; unusable where no joint was diagnosed.

    Lost frames are a fact of the time stamps, and explain no difference from the model.
    """
    if joints == 0:
        return "unusable"
    named = any(finding.effect != "dropped_frames" for finding in findings)
    if left:
        return "partly_explained" if named else "unknown_physics"
    return "explained" if named else "agrees"


def remainder(result: JointResult, stage: StageResult) -> Remainder:
    """What the model leaves of one signal, with the effects that explain a part of it and are not claimed."""
    search, wording = result.search, result.wording
    structure, stretches = _where(result, stage)
    claimed = result.claimed()
    parts = [found.effect for k, found in enumerate(search.accepted) if k not in claimed and found.stage == stage.stage]
    own = [tuple(parameter_numbers(result.reported, effect, wording)) for effect in parts]
    texts = [said(effect, numbers, wording) for effect, numbers in zip(parts, own, strict=True)]
    factor, unit = wording.signal_units[stage.stage]
    learned = _learned(result, stage.stage, structure)
    law = None if learned is None else described(learned, wording)
    family = PERIODIC["time"] if structure.tone > SETTINGS.min_tone_share else FAMILIES[structure.state]
    return Remainder(
        joint=result.joint,
        place=STAGE_PLACES[stage.stage],
        signal=wording.signals[stage.stage],
        rms=factor * stage.most_left.after,
        unit=unit,
        share=stage.most_left.left**2,
        probability=stage.other_physics,
        family=family if learned is None else learned.placed.family,
        when=stretches,
        candidates=tuple((effect.name, numbers) for effect, numbers in zip(parts, own, strict=True)),
        statement=f"{_statement(result, stage, structure, texts)} {_law_text(learned, law, factor, unit)}",
        split=stage.most_left.split,
        learned=learned,
        law=law,
    )


def _where(result: JointResult, stage: StageResult) -> tuple[Structure, tuple[tuple[float, float], ...]]:
    """On which state the residual depends, and when [s] it is large, in the data on which most is left."""
    search, whole = result.search, result.whole
    if stage.most_left.split != "test" or whole is None:
        return describe(search.problem, search.final, stage.stage), when(search, search.final, stage.stage)
    structure = describe_test(whole, search.final, stage.stage, free_axis=swings_freely(whole))
    begin, end = stretch_of_test(whole)
    return structure, ((round(begin, 2), round(end, 2)),)


def _learned(result: JointResult, stage: int, structure: Structure) -> RemainderLaw | None:
    """The law of what the claimed effects leave; of what the nominal model leaves, where one is not claimed."""
    search = result.search
    if result.whole is None:
        return None
    fit = search.final if len(result.claimed()) == len(search.accepted) else search.nominal
    return learn_remainder(search.problem, result.whole, fit, stage, structure)


def _law_text(learned: RemainderLaw | None, law: LawCurve | None, factor: float, unit: str) -> str:
    """What the law of a remainder is and what it gains. factor, unit: of the signal."""
    if learned is None or law is None:
        return "No law over one state is confirmed for it."
    on, errors = ("test", learned.test) if learned.test else ("validation", learned.validation)
    before, after = (f"{factor * error:.3g}" for error in errors)
    return (
        f"A law without a name describes it: {law.statement}. It reduces the error on {on} data from {before} to"
        f" {after} {unit}; model.yaml holds it as {learned.placed.effect.name}."
    )


def _statement(result: JointResult, stage: StageResult, structure: Structure, parts: Sequence[str]) -> str:
    """The sentences of a remainder. parts: the catalogue's sentences about effects that explain a part."""
    wording = result.wording
    (factor, unit), most = wording.signal_units[stage.stage], stage.most_left
    pace = f"has its spectrum around {structure.frequency_hz:.2g} Hz"
    if structure.tone > SETTINGS.min_tone_share:
        pace = f"is periodic in time with {structure.tone_hz:.3g} Hz ({structure.tone:.0%} of its variance)"
    elif structure.frequency_hz < SETTINGS.slow_hz:
        pace = "varies slowly"
    named = "beyond the findings" if any(k in result.claimed() for k in range(len(result.search.accepted))) else ""
    held = f" A part of it may be explained, which is not claimed: {'; '.join(parts)}." if parts else ""
    return (
        f"{result.joint}: {factor * most.after:.3g} {unit} RMS of the {wording.signals[stage.stage]} exceed the"
        f" noise of the {most.split} data{' ' * bool(named) + named}, and with a probability of"
        f" {stage.other_physics:.2f} they are physics that no effect of the catalogue explains. This remainder"
        f" depends most on the {wording.state(structure.state)} ({structure.share:.0%} of its variance), {pace}, and"
        f" differs by {factor * structure.direction:.2g} {unit} between {wording.positive} and {wording.negative}."
        f"{held} {errors_text(result, stage.stage)}"
    )
