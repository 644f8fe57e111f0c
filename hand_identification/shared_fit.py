"""Several joints fitted at once where one cause acts on all of them: some coordinates are shared, the others private.

Each Gauss-Newton step eliminates the private coordinates of every joint, which leaves one small system for the shared
ones (Schur complement; Triggs et al., Bundle Adjustment, 2000, Sec. 6.1). Cost, damping and bounds are those of
map_fit; the prior of the shared coordinates counts once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hand_identification.free_parameters import FreeParameter, merged
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import (
    MapFit,
    Point,
    bounded_step,
    bounds_of,
    costs_at,
    normal_equations,
    point_at,
    residual_slopes,
    usable_point,
)
from hand_identification.posterior import posterior_of
from hand_identification.settings import FITS
from hand_model.arrays import Array


@dataclass(frozen=True, slots=True)
class Part:
    """One joint of a shared fit: its problem, its private free parameters and where they start (private,)."""

    problem: JointProblem
    free: Sequence[FreeParameter]
    start: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedFit:
    """The best point of several joints.

    shared: the shared free parameters.  z: their coordinates (shared,).  fits: one for each joint, whose coordinates
    are the private ones and then the shared ones; without sensitivities.  cost: of all joints, each prior counted once.
    """

    shared: tuple[FreeParameter, ...]
    z: Array
    fits: tuple[MapFit, ...]
    cost: float

    def precision(self, shrink: Sequence[float] = ()) -> Array:
        """Precision of the shared coordinates (shared, shared) [-] with the prior, the private ones integrated out.

        shrink: factor of the curvature of each joint; none: 1.
        """
        count = len(self.shared)
        factors = shrink or [1.0] * len(self.fits)
        total = np.eye(count)
        for fit, factor in zip(self.fits, factors, strict=True):
            total += _eliminated(factor * fit.normal, np.zeros(len(fit.z)), len(fit.z) - count)[0]
        return total


@dataclass(frozen=True, slots=True)
class _Linear:
    """A joint around a point: its free parameters and bounds, J' W J without priors, the slope, and the point."""

    free: list[FreeParameter]
    bounds: tuple[Array, Array]
    normal: Array
    slope: Array
    at: Point


def shared_fit(
    parts: Sequence[Part],
    shared: Sequence[FreeParameter],
    start: Array,
    iterations: int = FITS.iterations,
    tolerance: float = FITS.tolerance,
) -> SharedFit:
    """Fit joints at once from the shared start (shared,) [-].

    A private parameter of the row of a shared one is left out. Stops as map_fit does, by the cost of all joints.
    """
    count = len(shared)
    frees = [merged(part.free, shared) for part in parts]
    points = [
        usable_point(part.problem, free, np.clip(np.concatenate([_kept(part, shared), start]), *bounds_of(free)))
        for part, free in zip(parts, frees, strict=True)
    ]
    z = np.clip(start, *bounds_of(shared))
    points = [
        point if np.array_equal(point.z[len(point.z) - count :], z) else point_at(part.problem, free, _with(point.z, z))
        for part, free, point in zip(parts, frees, points, strict=True)
    ]
    cost = _cost([point.cost for point in points], z)
    for done in range(1, iterations + 1):
        linear = [_linearised(part.problem, free, at) for part, free, at in zip(parts, frees, points, strict=True)]
        if done == iterations:
            break
        trials = [_step(linear, z, damping, longest) for damping, longest in FITS.trials]
        costs = np.array([costs_at(part.problem, free, np.array([trial[k] for trial in trials]))
                          for k, (part, free) in enumerate(zip(parts, frees, strict=True))])  # fmt: skip
        ends = [trial[0][len(trial[0]) - count :] for trial in trials]
        totals = np.array([_cost(costs[:, k], end) for k, end in enumerate(ends)])
        best = int(np.argmin(totals))
        if not totals[best] < cost - max(tolerance, FITS.relative_tolerance * cost):
            break
        z, cost = ends[best], float(totals[best])
        points = [
            point_at(part.problem, free, trials[best][k])
            for k, (part, free) in enumerate(zip(parts, frees, strict=True))
        ]
    return SharedFit(shared=tuple(shared), z=z, cost=cost, fits=tuple(_as_fit(each, done) for each in linear))


def _kept(part: Part, shared: Sequence[FreeParameter]) -> Array:
    """Starting coordinates of the private parameters whose rows are not shared."""
    rows = {parameter.row for parameter in shared}
    return part.start[[parameter.row not in rows for parameter in part.free]]


def _with(z: Array, shared: Array) -> Array:
    """Coordinates with other shared ones at their end."""
    return np.concatenate([z[: len(z) - len(shared)], shared])


def _cost(costs: Sequence[float] | Array, shared: Array) -> float:
    """The cost of all joints; each one's has the prior of the shared coordinates (shared,)."""
    return float(np.sum(costs) - (len(costs) - 1) * (shared @ shared))


def _linearised(problem: JointProblem, free: list[FreeParameter], at: Point) -> _Linear:
    bounds = bounds_of(free)
    sensitivity = residual_slopes(problem, free, at, bounds[1], FITS.difference)
    return _Linear(free, bounds, *normal_equations(problem, at.residuals, sensitivity), at)


def _eliminated(normal: Array, gradient: Array, private: int) -> tuple[Array, Array]:
    """What a joint adds to the precision and the gradient of the shared coordinates once its private ones follow.

    normal: (n, n) without priors, of which the first `private` get a unit prior.  gradient: (n,) with those priors.
    """
    own = normal[:private, :private] + np.eye(private)
    cross = normal[:private, private:]
    both = posterior_of(own)[0] @ np.column_stack([cross, gradient[:private]])
    return (
        normal[private:, private:] - cross.T @ both[:, :-1],
        gradient[private:] - cross.T @ both[:, -1],
    )


def _step(linear: Sequence[_Linear], z: Array, damping: float, longest: float) -> list[Array]:
    """New coordinates of every joint after one damped step, which is the same for the shared ones."""
    count = len(z)
    damped = [each.normal + damping * np.diag(np.diag(each.normal) + _prior(each, count)) for each in linear]
    total, gradient = (1.0 + damping) * np.eye(count), z.copy()
    for each, normal in zip(linear, damped, strict=True):
        private = len(each.at.z) - count
        slope = each.slope.copy()
        slope[:private] += each.at.z[:private]
        added = _eliminated(normal, slope, private)
        total, gradient = total + added[0], gradient + added[1]
    low, high = (bound[len(bound) - count :] for bound in linear[0].bounds)
    shared = bounded_step(total, gradient, np.maximum(low - z, -longest), np.minimum(high - z, longest))
    trials = []
    for each, normal in zip(linear, damped, strict=True):
        private = len(each.at.z) - count
        own = each.at.z[:private]
        toward = each.slope[:private] + own + normal[:private, private:] @ shared
        low, high = (bound[:private] for bound in each.bounds)
        step = bounded_step(
            normal[:private, :private] + np.eye(private),
            toward,
            np.maximum(low - own, -longest),
            np.minimum(high - own, longest),
        )
        trials.append(np.concatenate([own + step, z + shared]))
    return trials


def _prior(each: _Linear, shared: int) -> Array:
    """Precision (n,) of the priors of a joint's private coordinates."""
    return (np.arange(len(each.at.z)) < len(each.at.z) - shared).astype(float)


def _as_fit(each: _Linear, iterations: int) -> MapFit:
    return MapFit(
        free=tuple(each.free),
        z=each.at.z,
        cost=each.at.cost,
        squares=each.at.squares,
        residuals=tuple(each.at.residuals),
        normal=each.normal,
        sensitivity=(),
        iterations=iterations,
    )
