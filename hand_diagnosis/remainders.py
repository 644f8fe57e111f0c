"""Remainders: what the model leaves beyond the findings, with its own probability of being other physics.

The probability is that of verdict.StageResult.other_physics. Numbers and sentences are in the units and words of the
hand or machine they are about (hand_model/quantities).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hand_diagnosis.correction import sparse_correction
from hand_diagnosis.findings import Finding, JointResult, Number, errors_text, parameter_numbers, said, when
from hand_diagnosis.settings import SETTINGS
from hand_diagnosis.verdict import StageResult, Structure, describe

STAGE_PLACES = ("valve", "joint", "force_sensor")
"""Place of a remainder by the signal in which it shows."""
FAMILIES = {
    "angle": "depends_on_angle",
    "pressure": "depends_on_pressure",
    "speed": "depends_on_speed",
    "set-point": "depends_on_set_point",
    "time": "drifts_with_time",
}
"""Family of a remainder by the state on which it depends most."""
PERIODIC = "periodic_in_time"


@dataclass(frozen=True, slots=True)
class Remainder:
    """What the best model leaves of a signal of a joint, in the unit in which the signal is shown.

    rms: beyond the noise, on validation data.  share: of the mean square beyond the noise, 0 ... 1.
    probability: of being other physics than that named.  candidates: effects that explain a part and are not claimed,
    with their numbers.
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


def remainders(joints: Sequence[JointResult]) -> list[Remainder]:
    """What is more probably other physics than not, the largest in noise floors first."""
    left = [(result, stage) for result in joints for stage in result.results if stage.remains]
    left.sort(key=lambda pair: -pair[1].excess_after / pair[1].floor)
    return [remainder(result, stage) for result, stage in left]


def verdict(findings: Sequence[Finding], left: Sequence[Remainder]) -> str:
    """agrees, explained, partly_explained or unknown_physics."""
    if left:
        return "partly_explained" if any(f.effect != "dropped_frames" for f in findings) else "unknown_physics"
    return "explained" if findings else "agrees"


def remainder(result: JointResult, stage: StageResult) -> Remainder:
    """What the model leaves of one signal, with the effects that explain a part of it and are not claimed."""
    search, wording = result.search, result.wording
    structure = describe(search.problem, search.final, stage.stage)
    claimed = result.claimed()
    parts = [found.effect for k, found in enumerate(search.accepted) if k not in claimed and found.stage == stage.stage]
    own = [tuple(parameter_numbers(search, effect, wording)) for effect in parts]
    texts = [said(effect, numbers, wording) for effect, numbers in zip(parts, own, strict=True)]
    factor, unit = wording.signal_units[stage.stage]
    return Remainder(
        result.joint,
        STAGE_PLACES[stage.stage],
        wording.signals[stage.stage],
        factor * stage.excess_after,
        unit,
        stage.left**2,
        stage.other_physics,
        PERIODIC if structure.tone > SETTINGS.min_tone_share else FAMILIES[structure.state],
        when(search, search.final, stage.stage),
        tuple((effect.name, numbers) for effect, numbers in zip(parts, own, strict=True)),
        _statement(result, stage, structure, texts),
    )


def _statement(result: JointResult, stage: StageResult, structure: Structure, parts: Sequence[str]) -> str:
    """The sentences of a remainder. parts: the catalogue's sentences about effects that explain a part."""
    wording = result.wording
    factor, unit = wording.signal_units[stage.stage]
    pace = f"has its spectrum around {structure.frequency_hz:.2g} Hz"
    if structure.tone > SETTINGS.min_tone_share:
        pace = f"is periodic in time with {structure.tone_hz:.3g} Hz ({structure.tone:.0%} of its variance)"
    elif structure.frequency_hz < SETTINGS.slow_hz:
        pace = "varies slowly"
    named = "beyond the findings" if any(k in result.claimed() for k in range(len(result.search.accepted))) else ""
    held = f" A part of it may be explained, which is not claimed: {'; '.join(parts)}." if parts else ""
    correction = sparse_correction(result.search.problem, result.search.final, stage.stage, wording)
    (_, angle), (_, pressure) = wording.symbol_units
    position, drive, speed = wording.symbols
    return (
        f"{result.joint}: {factor * stage.excess_after:.3g} {unit} RMS of the {wording.signals[stage.stage]} exceed the"
        f" noise{' ' * bool(named) + named}, and with a probability of {stage.other_physics:.2f} they are physics that"
        f" no effect of the catalogue explains. This remainder depends most on the {wording.state(structure.state)}"
        f" ({structure.share:.0%} of its variance), {pace}, and differs by {factor * structure.direction:.2g} {unit}"
        f" between {wording.positive} and {wording.negative}.{held} {errors_text(result, stage.stage)}"
        f" A data-driven correction without physical meaning, {correction.text} {unit} ({position} in {angle}, {drive}"
        f" in {pressure}, {speed} in {angle}/s), removes {correction.validation_share:.0%} of its mean square on the"
        f" validation data."
    )
