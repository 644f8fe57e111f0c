"""Remainders: what the model leaves beyond the findings, with its own probability of being other physics.

The probability is that of verdict.StageResult.other_physics. Numbers and sentences are in the units and words of the
hand or machine they are about (hand_model/quantities).

A data-driven correction of a residual is fitted by sparse regression on polynomials of angle, pressure and speed with
the sign of the motion. It describes and does not explain; the report says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hand_diagnosis.findings import Finding, JointResult, Number, errors_text, parameter_numbers, said, when
from hand_diagnosis.settings import SETTINGS
from hand_diagnosis.verdict import StageResult, Structure, describe
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array
from hand_model.effects.effect import SPEED
from hand_model.quantities import Wording

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


@dataclass(frozen=True, slots=True)
class Correction:
    """residual [unit] = sum of coefficient times term; validation_share: of its mean square that it removes [-]."""

    unit: str
    terms: tuple[tuple[str, float], ...]
    validation_share: float

    @property
    def text(self) -> str:
        """The formula."""
        return " ".join(f"{value:+.3g}" + ("" if name == "1" else f" {name}") for name, value in self.terms) or "0"


def sparse_correction(problem: JointProblem, fit: MapFit, stage: int, wording: Wording) -> Correction:
    """Fit the residual of a signal on training blocks, in its shown unit, and evaluate it on validation blocks."""
    factor, unit = wording.signal_units[stage]
    libraries, targets, held = [], [], []
    for segment, residual in zip(problem.segments, fit.residuals, strict=True):
        use = segment.use[stage]
        states = segment.angle_rad[use], segment.pressure_pa[use], segment.exogenous[use, SPEED]
        libraries.append(correction_terms(*states, wording))
        targets.append(factor * residual[stage][use])
        held.append(problem.held_out[segment.block[use]])
    table = np.concatenate([np.column_stack(list(library.values())) for library in libraries])
    target, validation = np.concatenate(targets), np.concatenate(held)
    scale = np.maximum(np.abs(table).max(axis=0), 1e-12)
    rms = float(np.sqrt(np.mean(target**2))) or 1.0
    train = ~validation
    weights = thresholded_least_squares((table / scale)[train], (target / rms)[train]) * rms / scale
    left = target[validation] - table[validation] @ weights
    share = 1.0 - float(np.mean(left**2)) / max(float(np.mean(target[validation] ** 2)), 1e-300)
    terms = tuple((name, float(w)) for name, w in zip(libraries[0], weights, strict=True) if w != 0.0)
    return Correction(unit, terms, max(share, 0.0))


def thresholded_least_squares(table: Array, target: Array, threshold: float | None = None) -> Array:
    """Coefficients (n,) of the columns of a table (m, n) for a target (m,); those below a threshold are zero.

    Ridge regression and removal of small coefficients in turn, until none is small; then ordinary least squares on the
    columns that are left. Sequentially thresholded least squares: Brunton, Proctor and Kutz, PNAS 113(15), 2016.
    threshold: [unit of target over that of table]; None: SETTINGS.correction_threshold.
    """
    threshold = SETTINGS.correction_threshold if threshold is None else threshold
    kept = np.ones(table.shape[1], dtype=bool)
    for _ in range(SETTINGS.correction_iterations):
        ridge = np.sqrt(SETTINGS.correction_ridge) * np.eye(kept.sum())
        part = np.vstack([table[:, kept], ridge])
        found = np.linalg.lstsq(part, np.concatenate([target, np.zeros(len(ridge))]), rcond=None)[0]
        large = np.abs(found) >= threshold
        kept[kept] = large
        if large.all() or not kept.any():
            break
    coefficients = np.zeros(table.shape[1])
    if kept.any():
        coefficients[kept] = np.linalg.lstsq(table[:, kept], target, rcond=None)[0]
    return coefficients


def correction_terms(angle_rad: Array, pressure_pa: Array, speed_rad_s: Array, wording: Wording) -> dict[str, Array]:
    """Candidate terms (T,) of a correction by name, in the units of `wording.symbol_units`."""
    direction = np.tanh(speed_rad_s / SETTINGS.standing_rad_s)
    x, p, v = wording.symbols
    (per_angle, _), (per_pressure, _) = wording.symbol_units
    angle, pressure, speed = per_angle * angle_rad, per_pressure * pressure_pa, per_angle * speed_rad_s
    return {
        "1": np.ones_like(angle),
        x: angle,
        p: pressure,
        v: speed,
        f"{x}^2": angle**2,
        f"{x} {p}": angle * pressure,
        f"{p}^2": pressure**2,
        f"{x}^3": angle**3,
        f"sign({v})": direction,
        f"{p} sign({v})": pressure * direction,
        f"{v} |{v}|": speed * np.abs(speed),
    }
