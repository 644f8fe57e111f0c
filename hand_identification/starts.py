"""Where fits of an effect start: on the way to a probe, and elsewhere around a point that a fit has reached.

Simulation error has several minima. A fit that ends far above the noise may lie in the wrong one although its effect is
the right one: a limit that does not act has no slope. The cheapest points elsewhere are then fitted as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hand_identification.free_parameters import START_CREEP, FreeParameter, with_stops_where_turned
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, costs_at, map_fit
from hand_identification.settings import FITS
from hand_model.arrays import Array
from hand_model.kernel.plant_rows import PLANT_PARAMETERS


def has_expected_value(parameter: FreeParameter) -> bool:
    """Whether a parameter can be released to an expected value: nominal numbers and first speeds can."""
    return not parameter.log and (parameter.row < len(PLANT_PARAMETERS) or parameter.row > START_CREEP)


def fit_plain(problem: JointProblem, free: Sequence[FreeParameter], start: Array, iterations: int) -> MapFit:
    """The plain plant fitted from a start (free,) [-], and on from stops where the joint turned if that fits better."""
    fit = map_fit(problem, free, start, iterations)
    turned = with_stops_where_turned(free, fit.z, problem.nominal, problem.motion_rad)
    if turned is None:
        return fit
    return min(fit, map_fit(problem, free, turned, iterations), key=lambda each: each.cost)


@dataclass(frozen=True, slots=True)
class Way:
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


@dataclass(frozen=True, slots=True)
class Elsewhere:
    """Which points are tried: their number, how many are kept, their reach [prior sd], least change of the cost [-]."""

    points: int
    kept: int
    reach: float
    change: float


def around(problem: JointProblem, fit: MapFit, rows: set[int], how: Elsewhere, rng: np.random.Generator) -> list[Array]:
    """The cheapest points (free,) that differ from a fit in one or two of the numbers of these rows, of each pair one.

    Each number takes values over its range, within the reach of the mode of its prior, and its bounds, where a form
    often ends. A quarter of the points releases the nominal numbers, which a fit in a wrong minimum has shifted.
    """
    own = [k for k, p in enumerate(fit.free) if p.row in rows]
    if not own:
        return []
    released = np.array([p.row not in rows and has_expected_value(p) for p in fit.free])
    points, changed = np.tile(fit.z, (how.points, 1)), []
    for number, point in enumerate(points):
        if number % FITS.released_every == 0:
            point[released] = 0.0
        numbers = rng.choice(own, size=min(1 + (number % FITS.released_every > 0), len(own)), replace=False)
        for k in numbers:
            point[k] = _anywhere(fit.free[k], how.reach, rng)
        changed.append(frozenset(numbers.tolist()))
    costs = costs_at(problem, fit.free, np.vstack([fit.z, points]))
    best: dict[frozenset[int], int] = {}
    for k in np.argsort(costs[1:], kind="stable"):
        # A number that does not act where the fit ended changes nothing: from there, the fit would return.
        if np.isfinite(costs[1 + k]) and abs(costs[1 + k] - costs[0]) > how.change * costs[0]:
            best.setdefault(changed[k], int(k))
    return [points[k] for k in list(best.values())[: how.kept]]


def _anywhere(parameter: FreeParameter, reach: float, rng: np.random.Generator) -> float:
    """A coordinate drawn over the range of a parameter; one in two is a bound that lies within reach."""
    low, high = (_within(parameter, side * reach) for side in (-1.0, 1.0))
    ends = [end for end in (low, high) if abs(end) < reach]
    if ends and rng.random() < FITS.bound_share:
        return float(rng.choice(ends))
    return float(rng.uniform(low, high))


def _within(parameter: FreeParameter, z: float) -> float:
    """A coordinate moved into the bounds of its parameter."""
    if parameter.log and parameter.low <= 0.0:
        return min(z, parameter.coordinate(parameter.high))
    return min(max(z, parameter.coordinate(parameter.low)), parameter.coordinate(parameter.high))
