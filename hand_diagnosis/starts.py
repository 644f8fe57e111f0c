"""Where fits of an effect start: on the way to its probes, and around a point that a fit has reached.

Simulation error has several minima. A fit that ends far above the noise may lie in the wrong one although its effect is
the right one: a limit that does not act has no slope. The cheapest points elsewhere are then fitted as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hand_diagnosis.settings import SETTINGS, FitPass
from hand_identification.free_parameters import (
    START_CREEP,
    FreeParameter,
    effect_free_parameters,
    merged,
    probe_values,
)
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, costs_at
from hand_model.arrays import Array
from hand_model.effects.effect import Effect
from hand_model.kernel.plant_rows import PLANT_PARAMETERS
from hand_model.kernel.rows import ROW


@dataclass(frozen=True, slots=True)
class Screened:
    """An effect, the fall of the cost that its best probe promises, and where to start: values by row (SI), share."""

    effect: Effect
    gain: float
    start: dict[int, float]
    share: float


def begin(
    problem: JointProblem, current: MapFit, screened: Screened, fit_pass: FitPass
) -> tuple[list[FreeParameter], Array, Array]:
    """Free parameters of the model with an effect, points to start from (k, free), the screen's first, costs (k,)."""
    free = merged(current.free, effect_free_parameters(screened.effect, problem.nominal))
    starts = np.array(_starts(problem, current, screened, free))
    return free, starts, costs_at(replace(problem, step_s=fit_pass.step_s), free, starts)


def _starts(
    problem: JointProblem, current: MapFit, screened: Screened, free: Sequence[FreeParameter]
) -> list[list[float]]:
    """Coordinates to start from: the screen's own first, then probes at several shares of the way to them.

    Each of the latter twice: with the nominal numbers as they are, and released to their expected values. A large
    effect has shifted the nominal numbers; from their expected values the way to the solution is shorter.
    """
    columns, _ = problem.columns(current.free, current.z[None])
    here = {parameter.row: float(z) for parameter, z in zip(current.free, current.z, strict=True)}
    own = {ROW[key] for key in screened.effect.keys}
    others = [probe for probe in probe_values(screened.effect, columns[0]) if probe != screened.start]
    share = min(max(screened.share, SETTINGS.start_share_low), SETTINGS.start_share_high)
    way = _Way(columns[0], here, screened.effect.shape)
    starts = [[way.coordinate(parameter, screened.start, share) for parameter in free]]
    for probe in [screened.start, *others][: SETTINGS.probes_tried]:
        for share in SETTINGS.probe_shares:
            start = [way.coordinate(parameter, probe, share) for parameter in free]
            released = [
                0.0 if parameter.row not in own and _has_expected_value(parameter) else z
                for parameter, z in zip(free, start, strict=True)
            ]
            starts += [start, released]
    return starts


def _has_expected_value(parameter: FreeParameter) -> bool:
    """Whether a parameter can be released to an expected value: nominal numbers and first speeds can."""
    return not parameter.log and (parameter.row < len(PLANT_PARAMETERS) or parameter.row > START_CREEP)


@dataclass(frozen=True, slots=True)
class _Way:
    """From the current point to a probe. values: (rows,) SI.  here: coordinates by row.  shape: keys of no size."""

    values: Array
    here: dict[int, float]
    shape: Sequence[str]

    def coordinate(self, parameter: FreeParameter, probe: dict[int, float], share: float) -> float:
        """A share of the way to the probe's value (all of it for a shape); other coordinates as they are."""
        if parameter.row in probe:
            now, there = float(self.values[parameter.row]), probe[parameter.row]
            return parameter.coordinate(there if parameter.key in self.shape else now + share * (there - now))
        if parameter.row in self.here:
            return self.here[parameter.row]
        return parameter.coordinate(float(self.values[parameter.row])) if parameter.row < len(self.values) else 0.0


def around(problem: JointProblem, fit: MapFit, rows: set[int], rng: np.random.Generator) -> list[Array]:
    """The cheapest points (free,) that differ from a fit in one or two of the numbers of these rows, of each pair one.

    Each number takes values over its range, within SETTINGS.restart_reach prior standard deviations of its mode, and
    its bounds, where a form often ends. A quarter of the points releases the nominal numbers, which a fit in a wrong
    minimum has shifted.
    """
    own = [k for k, p in enumerate(fit.free) if p.row in rows]
    if not own:
        return []
    released = np.array([p.row not in rows and _has_expected_value(p) for p in fit.free])
    points, changed = np.tile(fit.z, (SETTINGS.restart_points, 1)), []
    for number, point in enumerate(points):
        if number % 4 == 0:
            point[released] = 0.0
        numbers = rng.choice(own, size=min(1 + (number % 4 > 0), len(own)), replace=False)
        for k in numbers:
            point[k] = _anywhere(fit.free[k], rng)
        changed.append(frozenset(numbers.tolist()))
    costs = costs_at(problem, fit.free, np.vstack([fit.z, points]))
    best: dict[frozenset[int], int] = {}
    for k in np.argsort(costs[1:], kind="stable"):
        # A number that does not act where the fit ended changes nothing: from there, the fit would return.
        if _differs(costs[1 + k], costs[0]):
            best.setdefault(changed[k], int(k))
    return [points[k] for k in list(best.values())[: SETTINGS.restart_fits]]


def _differs(cost: float, reference: float) -> bool:
    """Whether a finite cost is clearly not that of a reference."""
    return bool(np.isfinite(cost) and abs(cost - reference) > 0.01 * reference)


def _anywhere(parameter: FreeParameter, rng: np.random.Generator) -> float:
    """A coordinate drawn over the range of a parameter; one in two is a bound that lies within reach."""
    reach = SETTINGS.restart_reach
    low, high = (_within(parameter, side * reach) for side in (-1.0, 1.0))
    ends = [end for end in (low, high) if abs(end) < reach]
    if ends and rng.random() < 0.5:
        return float(rng.choice(ends))
    return float(rng.uniform(low, high))


def _within(parameter: FreeParameter, z: float) -> float:
    """A coordinate moved into the bounds of its parameter."""
    if parameter.log and parameter.low <= 0.0:
        return min(z, parameter.coordinate(parameter.high))
    return min(max(z, parameter.coordinate(parameter.low)), parameter.coordinate(parameter.high))
