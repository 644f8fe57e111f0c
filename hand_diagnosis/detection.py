"""Detection limits: how small an effect this recording would still have shown, where model and recording agree.

For every effect of the catalogue, its probes are simulated on the recording's own inputs at several shares of their
size. Of the change s of the prediction, the fitted numbers of the model take what they can within their tolerance (the
MAP response to s); the rest s' would be seen. The effect counts as shown down to the smallest share at which

- the root mean square of s' on validation data exceeds the error that an effect must remove (JointProblem.claimable),
- the validation error would fall by more than SETTINGS.min_relative_improvement, and
- the log evidence would rise by SETTINGS.strong_log_evidence or more: the log likelihood of the residual of this
  recording against that of the residual and s' together, minus Occam's factor of the effect's amount.

These are the conditions of the search for an effect, in expectation over the noise, for one amount at a time: further
numbers of an effect and rival effects cost evidence, too, so a limit holds for the effect alone.

Of a long recording only the beginning is used (SETTINGS.limit_samples); the whole shows no less.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hand_diagnosis.diagnosis import Diagnosis, JointDiagnosis
from hand_diagnosis.pages.headline import effect_words
from hand_diagnosis.problem import log_likelihood, slice_of, validation_rmse
from hand_diagnosis.search import Probes, probes_at
from hand_diagnosis.settings import SETTINGS
from hand_identification.free_parameters import effect_free_parameters
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, map_fit
from hand_model.arrays import Array, Flags
from hand_model.effects.effect import Effect
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_model.quantities import Wording, unit_words


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """The smallest size of an effect that a joint's recording would have shown.

    value: of the number `parameter`, in its unit, which is `nominal` in the model; None where not even the effect at
    its usual size is shown.  others: the effect's other numbers there, with units.  signal: that shows it.
    """

    joint: str
    effect: str
    parameter: str
    unit: str
    nominal: float
    value: float | None
    others: tuple[tuple[str, float, str], ...]
    signal: str | None

    def document(self) -> dict[str, Any]:
        """For report.json."""
        return {
            "joint": self.joint,
            "effect": self.effect,
            "parameter": self.parameter,
            "unit": self.unit,
            "nominal": self.nominal,
            "value": self.value,
            "signal": self.signal,
            "others": {key: {"value": value, "unit": unit} for key, value, unit in self.others},
        }


@dataclass(frozen=True, slots=True)
class Tried:
    """Probes at shares of their size. passes: (probes,) whether they are shown; stage: (probes,) by which signal."""

    passes: Flags
    stage: Array


def detection_limits(diagnosis: Diagnosis, effects: Sequence[Effect]) -> list[dict[str, Any]]:
    """The rows `detection_limits` of report.json; none unless model and recording agree. effects: of the catalogue."""
    if diagnosis.verdict != "agrees":
        return []
    return [limit.document() for joint in diagnosis.joints for limit in limits_of(joint, effects)]


def limits_of(joint: JointDiagnosis, effects: Sequence[Effect]) -> list[Limit]:
    """The limit of every effect that can change a signal of a joint, in the order of the catalogue."""
    problem, final = beginning(joint.search.problem, SETTINGS.limit_samples), joint.search.final
    fit = map_fit(problem, final.free, final.z, 1)  # its sensitivities were not kept
    probes = probes_at(problem, fit, effects)
    if not probes.probes:
        return []
    keeps = _keeps_shape(problem, fit, probes)
    passing, stage = _smallest_shares(problem, fit, probes, keeps)
    found = []
    for effect in effects:
        own = [k for k, (each, _) in enumerate(probes.probes) if each is effect]
        if own:
            best = min(own, key=lambda k: (passing[k], k))
            shown = np.isfinite(passing[best])
            share = float(passing[best]) if shown else 1.0
            values = _scaled(problem, fit, probes, np.full(len(keeps), share), keeps).probes[best][1]
            apart = _shapes(effect) if keeps[best] else frozenset[int]()
            found.append(_limit(joint, effect, values, int(stage[best]) if shown else None, apart))
    return found


def _smallest_shares(problem: JointProblem, fit: MapFit, probes: Probes, keeps: Flags) -> tuple[Array, Array]:
    """Smallest share of each probe that is shown (probes,) [-], infinite for none, and the signal that shows it."""
    count = len(probes.probes)
    high, low, stage = np.full(count, np.inf), np.zeros(count), np.zeros(count)
    still = np.ones(count, dtype=bool)  # shown at every larger share
    for share in sorted(SETTINGS.limit_shares, reverse=True):
        tried = _tried(problem, fit, probes, np.full(count, share), keeps, still)
        low[still & ~tried.passes & np.isfinite(high)] = share
        still &= tried.passes
        high[still], stage[still] = share, tried.stage[still]
    best = _smallest_of_effect(probes, high)
    for _ in range(SETTINGS.limit_halvings):
        open_ = best & np.isfinite(high) & (low > 0.0)
        middle = np.sqrt(np.where(open_, low, 1.0) * np.where(open_, high, 1.0))
        tried = _tried(problem, fit, probes, middle, keeps, open_)
        down, up = open_ & tried.passes, open_ & ~tried.passes
        high[down], stage[down] = middle[down], tried.stage[down]
        low[up] = middle[up]
    return high, stage


def _smallest_of_effect(probes: Probes, high: Array) -> Flags:
    """Which probes (probes,) have the smallest value of their effect; no other can have its limit."""
    least: dict[str, float] = {}
    for (effect, _), value in zip(probes.probes, high, strict=True):
        least[effect.name] = min(least.get(effect.name, np.inf), float(value))
    return np.array([value <= least[effect.name] for (effect, _), value in zip(probes.probes, high, strict=True)])


def _tried(problem: JointProblem, fit: MapFit, probes: Probes, shares: Array, keeps: Flags, only: Flags) -> Tried:
    """Which probes at a share (probes,) of their size are shown; only: (probes,) those that are tried."""
    where = np.flatnonzero(only)
    own = replace(probes, probes=[probes.probes[k] for k in where], columns=probes.columns[where])
    scaled = _scaled(problem, fit, own, shares[where], keeps[where])
    passes, stage = np.zeros(len(shares), dtype=bool), np.zeros(len(shares))
    prior = fit.covariance
    for part, changed in scaled.changed_residuals(problem, SETTINGS.probes_at_once):
        seen, response = _unabsorbed(problem, fit, prior, changed)
        squares = problem.block_squares(seen)
        for k, (index, its_squares) in enumerate(zip(range(len(where))[part], squares, strict=True)):
            effect, values = scaled.probes[index]
            if np.isfinite(its_squares).all():
                shown = _is_shown(problem, fit, effect, values, its_squares, response[k])
                passes[where[index]], stage[where[index]] = shown
    return Tried(passes, stage)


def _scaled(problem: JointProblem, fit: MapFit, probes: Probes, shares: Array, keeps: Flags) -> Probes:
    """The probes at a share (probes,) of the way from the model to them; keeps: (probes,) the shape is the probe's."""
    base, _ = problem.columns(fit.free, fit.z[None])
    columns, scaled = np.repeat(base, len(shares), axis=0), []
    for column, (effect, values), share, keep in zip(columns, probes.probes, shares, keeps, strict=True):
        kept = _shapes(effect) if keep else frozenset[int]()
        own = {row: v if row in kept else base[0, row] + share * (v - base[0, row]) for row, v in values.items()}
        for row, value in own.items():
            column[row] = value
        scaled.append((effect, {row: float(value) for row, value in own.items()}))
    return replace(probes, probes=scaled, columns=columns)


def _keeps_shape(problem: JointProblem, fit: MapFit, probes: Probes) -> Flags:
    """Whether the shape of each probe (probes,) shows nothing without its amount; that of end stops does."""
    every = np.ones(len(probes.probes), dtype=bool)
    return ~_tried(problem, fit, probes, np.zeros(len(every)), every, every).passes


def _shapes(effect: Effect) -> frozenset[int]:
    return frozenset(ROW[key] for key in effect.shape)


def _unabsorbed(
    problem: JointProblem, fit: MapFit, prior: Array, changed: Sequence[Array]
) -> tuple[list[Array], Array]:
    """What the fitted numbers leave of changes (k, OUTPUTS, T) by segment, and their responses (k, free)."""
    train = (~problem.validation).astype(float)
    slope = np.zeros((len(changed[0]), len(fit.z)))
    changes = [np.nan_to_num(new - old, posinf=np.inf) for new, old in zip(changed, fit.residuals, strict=True)]
    for segment, change, slopes in zip(problem.segments, changes, fit.sensitivity, strict=True):
        weight = np.sqrt(problem.weight)[:, None] * train[segment.block][None]
        slope += np.tensordot(change * weight, slopes * weight, axes=((1, 2), (1, 2)))
    response = -slope @ prior
    left = [
        change + np.tensordot(response, slopes, axes=(1, 0))
        for change, slopes in zip(changes, fit.sensitivity, strict=True)
    ]
    return left, response


def _is_shown(
    problem: JointProblem, fit: MapFit, effect: Effect, values: dict[int, float], squares: Array, response: Array
) -> tuple[bool, int]:
    """Whether the search would accept a change with these squares (OUTPUTS, blocks), and by which signal."""
    seen = np.nan_to_num(validation_rmse(problem, squares))
    stage = int(np.argmax(seen / problem.floor))
    before = float(np.nan_to_num(validation_rmse(problem, fit.squares + squares))[stage])
    after = float(np.nan_to_num(validation_rmse(problem, fit.squares))[stage])
    large = seen[stage] > problem.claimable[stage]
    if not large or before - after <= SETTINGS.min_relative_improvement * before:
        return False, stage
    train = ~problem.validation
    gain = 0.5 * float(response @ response)
    for blocks in (train, ~train):
        gain += log_likelihood(problem, fit.squares, blocks) - log_likelihood(problem, fit.squares + squares, blocks)
    information = float((problem.weight * squares[:, train].sum(axis=1)).sum())
    return gain - _occam(problem, effect, values, information) >= SETTINGS.strong_log_evidence, stage


def _occam(problem: JointProblem, effect: Effect, values: dict[int, float], information: float) -> float:
    """Log evidence that one amount costs: its prior at the value, and its posterior's width over the prior's."""
    amounts = [
        p for p in effect_free_parameters(effect, problem.nominal) if p.row in values and p.key not in effect.shape
    ]
    coordinates = np.array([p.coordinate(values[p.row]) for p in amounts if values[p.row] != problem.nominal[p.row]])
    squared = float((coordinates**2).max()) if len(coordinates) else 1.0
    return 0.5 * (squared + float(np.log1p(information / max(squared, SETTINGS.limit_min_coordinate**2))))


def _limit(
    joint: JointDiagnosis, effect: Effect, values: dict[int, float], stage: int | None, apart: frozenset[int]
) -> Limit:
    """A limit in the words and units of the hand or machine, by the number that changes most; apart: rows of shapes."""
    nominal, wording = joint.search.problem.nominal, joint.wording
    moved = {
        p.row: abs(values[p.row] - float(nominal[p.row])) / (p.centre if p.log else p.scale)
        for p in effect_free_parameters(effect, nominal)
        if p.row in values and p.row not in apart
    }
    main = max(moved, key=lambda row: moved[row])
    numbers = {row: _number(key, values[row], wording) for key, row in _rows(effect) if row in values}
    name, value, unit = numbers[main]
    before = _number(_key(effect, main), float(nominal[main]), wording)[1]
    others = tuple(number for row, number in numbers.items() if row != main and values[row] != nominal[row])
    signal = None if stage is None else wording.signals[stage]
    return Limit(
        joint=joint.joint,
        effect=effect.name,
        parameter=name,
        unit=unit,
        nominal=before,
        value=None if stage is None else value,
        others=others,
        signal=signal,
    )


def _rows(effect: Effect) -> list[tuple[str, int]]:
    return [(key, ROW[key]) for key in effect.keys]


def _key(effect: Effect, row: int) -> str:
    return next(key for key, own in _rows(effect) if own == row)


def _number(key: str, value: float, wording: Wording) -> tuple[str, float, str]:
    """A parameter [SI] as the hand or machine has it: key, value, unit."""
    quantity = wording.units.quantity(key)
    return quantity.key, quantity.factor / JOINT_PARAMETERS[ROW[key]].scale * value, quantity.unit


def limit_table(limits: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[list[str]]]:
    """The rows of report.json as a table for the page: names of the joints, and a row for each effect and number.

    A number that the model has already stands before its limit.
    """
    joints = list(dict.fromkeys(row["joint"] for row in limits))
    cells: dict[tuple[str, str, str], dict[str, str]] = {}
    for row in limits:
        key = (effect_words(row["effect"]), row["parameter"], unit_words(row["unit"]))
        cells.setdefault(key, {})[row["joint"]] = _cell(row)
    shown = [[*key, *(by_joint.get(joint, "") for joint in joints)] for key, by_joint in cells.items()]
    return joints, shown


def _cell(row: Mapping[str, Any]) -> str:
    if row["value"] is None:
        return "not shown"
    if row["nominal"] == 0.0:
        return _two_digits(row["value"])
    return f"{row['nominal']:.3g} → {row['value']:.3g}"


def _two_digits(value: float) -> str:
    """A number with two significant digits, large ones without an exponent."""
    return f"{float(f'{value:.2g}'):g}"


def beginning(problem: JointProblem, samples: int) -> JointProblem:
    """The problem with at most about so many samples in all, the same share of each segment from its beginning."""
    total = sum(len(segment.angle_rad) for segment in problem.segments)
    if total <= samples:
        return problem
    return replace(
        problem, segments=[slice_of(s, 0, max(len(s.angle_rad) * samples // total, 2)) for s in problem.segments]
    )
