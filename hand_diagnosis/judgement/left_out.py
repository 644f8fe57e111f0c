"""In which recordings of a machine what was found holds: each recording is left out of the fit in turn.

The effects are chosen; their numbers are fitted again to the other recordings, and predict that one. An effect whose
numbers do not reduce the error there describes only what it was fitted to. And numbers that predict worse than those
of the machine file are not written: a plant that differs between recordings draws them away. A recording that moves in
a direction which the others lack is not left out: they do not show what friction is there.
Source: leave-one-group-out cross-validation (Stone, J. Royal Statistical Society B 36(2), 1974).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hand_diagnosis.search import JointSearch, fit_without, refit_below_floor
from hand_diagnosis.settings import SETTINGS
from hand_identification.free_parameters import START_CREEP, FreeParameter, merged
from hand_identification.joint_problem import JointProblem, Segment
from hand_identification.map_fit import map_fit, start_at
from hand_model.arrays import Array
from hand_model.effects.effect import SPEED
from hand_model.kernel.layout import CREEP, OMEGA
from hand_model.kernel.open_loop import OUTPUTS
from hand_model.quantities import Wording

Model = tuple[list[FreeParameter], Array]
"""Free parameters, and coordinates (free,) near the best ones."""


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Errors (recordings, OUTPUTS) [SI] of the nominal and the final model on recordings that were left out.

    NaN for a signal that a recording does not have.  withdrawn: effects that do not reduce the error there, each with
    the two errors without and with it, in floors [-].  numbers: errors on all of them in floors [-], of the stated
    numbers and of those that are fitted to the other recordings, without effects.  alone: recordings that are not left
    out, because they move in a direction in which no other does; their errors are NaN.
    """

    recordings: tuple[str, ...]
    before: Array
    after: Array
    withdrawn: tuple[tuple[str, float, float], ...] = ()
    numbers: tuple[float, float] = (np.inf, 0.0)
    alone: tuple[str, ...] = ()

    @property
    def stated_hold(self) -> bool:
        """Whether the stated numbers predict recordings better than those fitted to the others."""
        return self.numbers[0] < self.numbers[1]


def leave_one_out(whole: JointProblem, search: JointSearch) -> LeftOut | None:
    """Predict each recording from the others, and withdraw effects of the search that do not hold; None for one."""
    if len(whole.segments) < 2:
        return None
    names, tested = tuple(segment.name for segment in whole.segments), covered(whole.segments)
    alone = tuple(name for k, name in enumerate(names) if k not in tested)
    if not tested:
        nothing = np.full((len(names), OUTPUTS), np.nan)
        return LeftOut(names, nothing, nothing, alone=alone)
    withdrawn: list[tuple[str, float, float]] = []
    while True:
        models = [_model(search, ()), _model(search, range(len(search.accepted))), _stated(search)]
        count = len(search.accepted)
        if count > 1:
            models += [_model(search, [k for k in range(count) if k != left]) for left in range(count)]
        errors = _errors(whole, models, tested)
        total = [float(np.sqrt(np.nanmean((error / whole.floor) ** 2))) for error in errors]
        without = total[3:] if count > 1 else total[:1] * count
        if not count or min(without) > total[1]:
            return LeftOut(names, errors[0], errors[1], tuple(withdrawn), (total[2], total[0]), alone)
        worst = int(np.argmin(without))
        withdrawn.append((search.accepted[worst].effect.name, without[worst], total[1]))
        _withdraw(search, worst)


def _model(search: JointSearch, kept: Sequence[int]) -> Model:
    """The model with some of the accepted effects, at the coordinates of the last fit that has them all."""
    fit = search.final if kept else search.nominal
    free = list(search.nominal.free)
    for k in kept:
        free = merged(free, search.accepted[k].free_parameters(search.problem.nominal))
    if len(kept) == len(search.accepted):
        free = list(fit.free)
    return free, start_at(free, fit.by_row)


def _stated(search: JointSearch) -> Model:
    """The model with the stated numbers; only creep and speed at the beginning of a recording are free."""
    kept = [(p, z) for p, z in zip(search.nominal.free, search.nominal.z, strict=True) if p.row >= START_CREEP]
    return [p for p, _ in kept], np.array([z for _, z in kept])


def with_stated_numbers(search: JointSearch) -> JointSearch:
    """The search with the stated numbers in the model without effects."""
    free, z = _stated(search)
    return replace(search, nominal=map_fit(search.problem, free, z, SETTINGS.rough_iterations))


def covered(segments: Sequence[Segment]) -> list[int]:
    """Numbers of the recordings that move in no direction but those in which others move, too."""
    ways = [_directions(segment) for segment in segments]
    return [k for k, own in enumerate(ways) if own <= set[int]().union(*ways[:k], *ways[k + 1 :])]


def _directions(segment: Segment) -> set[int]:
    """The signs of the speeds, 1 and -1, that make more than a small share of the travel of a recording."""
    speed = segment.exogenous[:, SPEED]
    least = SETTINGS.least_direction_share * float(np.abs(speed).sum())
    return {sign for sign in (1, -1) if float(np.maximum(sign * speed, 0.0).sum()) > least}


def _errors(whole: JointProblem, models: Sequence[Model], tested: Sequence[int]) -> list[Array]:
    """RMS errors (recordings, OUTPUTS) [SI] of each model on recordings, those of `tested`, fitted to all others."""
    found = [np.full((len(whole.segments), OUTPUTS), np.nan) for _ in models]
    for left in tested:
        segment = whole.segments[left]
        kept = [k for k in range(len(whole.segments)) if k != left]
        others = replace(whole, segments=[whole.segments[k] for k in kept])
        alone = replace(whole, segments=[segment])
        counts = segment.use.sum(axis=1)
        for error, model in zip(found, models, strict=True):
            free, z = _renumbered(model, kept)
            fit = map_fit(others, free, z, SETTINGS.rough_iterations)
            columns, starts = others.columns(fit.free, fit.z[None])
            start = np.array([[starts[0, 0] if starts[0, 0] else segment.start[CREEP], segment.start[OMEGA]]])
            squares = (alone.residuals(columns, start)[0][0] ** 2).sum(axis=1)
            error[left, counts > 0] = np.sqrt(squares[counts > 0] / counts[counts > 0])
    return found


def _renumbered(model: Model, kept: Sequence[int]) -> Model:
    """The free parameters where only some recordings are fitted; first speeds are numbered by recording."""
    first = START_CREEP + 1
    free, z = [], []
    for parameter, value in zip(*model, strict=True):
        number = parameter.row - first
        if number < 0:
            free.append(parameter)
        elif number in kept:
            free.append(replace(parameter, row=first + kept.index(number)))
        else:
            continue
        z.append(value)
    return free, np.array(z)


def _withdraw(search: JointSearch, index: int) -> None:
    """Remove one of the accepted effects, and fit the others again."""
    if len(search.accepted) == 1:
        search.accepted.clear()
        return
    evidence, fit = fit_without(search, index)
    kept = [hypothesis for k, hypothesis in enumerate(search.accepted) if k != index]
    kept[-1] = replace(kept[-1], fit=refit_below_floor(search.problem, fit), log_evidence=evidence)
    search.accepted[:] = kept


def number_lines(joint: str, found: LeftOut | None) -> list[str]:
    """Lines about recordings that could not be left out, and stated numbers that hold better than fitted ones."""
    if found is None:
        return []
    lines = [
        f"{joint}: {name} moves in a direction in which no other recording does; what was found is not tested on it."
        " Record that direction twice, or both directions in one recording"
        for name in found.alone
    ]
    if not found.stated_hold:
        return lines
    stated, fitted = found.numbers
    return [
        *lines,
        f"{joint}: numbers fitted to the other recordings predict the one left out worse ({fitted:.3g} floors) than"
        f" those of the machine file do ({stated:.3g} floors); model.yaml keeps the latter where no effect is claimed",
    ]


def error_rows(joint: str, found: LeftOut | None, wording: Wording) -> list[dict[str, Any]]:
    """For report.json: the errors on each recording, by models that were fitted to the others, in its units."""
    if found is None:
        return []
    return [
        {
            "joint": joint,
            "recording": recording,
            "signal": wording.signals[stage],
            "unit": unit,
            "rmse_before": factor * float(found.before[k, stage]),
            "rmse_after": factor * float(found.after[k, stage]),
        }
        for k, recording in enumerate(found.recordings)
        for stage, (factor, unit) in enumerate(wording.signal_units)
        if np.isfinite(found.before[k, stage])
    ]


def withdrawn_rows(joint: str, found: LeftOut | None, others: Sequence[tuple[str, str]]) -> list[dict[str, str]]:
    """For report.json: effects that were withdrawn, and why. others: those withdrawn before, with the reasons."""
    rows = list(others)
    for name, without, having in found.withdrawn if found else ():
        change = f"{without:.3g} floors without it, {having:.3g} with it"
        rows.append((name, f"its gain does not carry over to recordings left out of the fit ({change})"))
    return [{"joint": joint, "effect": name, "reason": reason} for name, reason in rows]
