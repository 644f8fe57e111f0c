"""Maximum a posteriori fit of a joint by simulation error: damped Gauss-Newton, all parameter sets in one simulation.

The cost is the sum of weighted squared residuals of the training blocks plus z' z, the prior of the coordinates.
Source: Levenberg-Marquardt method (Nocedal and Wright 2006, Sec. 10.3) with several dampings tried at once, within a
box: a coordinate at its longest change leaves the others free to follow. The result is checked against
scipy.optimize.least_squares (test/identification/test_map_fit.py).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hand_identification.free_parameters import START_CREEP, FreeParameter, values_of
from hand_identification.joint_problem import JointProblem
from hand_identification.posterior import covariance_of
from hand_identification.settings import FITS
from hand_model.arrays import Array
from hand_model.compile_cache import njit
from hand_model.kernel.open_stages import LANES

AT_ONCE = 2 * LANES
"""Coordinates whose costs are computed at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MapFit:
    """The best point of a fit.

    z: coordinates (free,).  cost: weighted squares of the training data + z' z.  squares: (OUTPUTS, blocks), SI.
    residuals: (OUTPUTS, T) by segment, SI.  normal: J' W J (free, free) of the training data alone.
    sensitivity: slopes of the residuals (free, OUTPUTS, T) by segment.
    """

    free: tuple[FreeParameter, ...]
    z: Array
    cost: float
    squares: Array
    residuals: tuple[Array, ...]
    normal: Array
    sensitivity: tuple[Array, ...]
    iterations: int

    def without_arrays(self) -> MapFit:
        """The same fit without its large arrays, for hypotheses that are reported and not used further."""
        return replace(self, residuals=(), sensitivity=())

    def without_slopes(self) -> MapFit:
        """The same fit without its largest arrays, which `with_slopes` computes again."""
        return replace(self, sensitivity=())

    @property
    def by_row(self) -> dict[int, float]:
        """The coordinates [-] by the row of their parameter."""
        return {parameter.row: float(z) for parameter, z in zip(self.free, self.z, strict=True)}

    @property
    def covariance(self) -> Array:
        """Posterior covariance of z (free, free), the prior included."""
        return covariance_of(self.normal)

    def in_terms_of(self, free: Sequence[FreeParameter]) -> Array:
        """Coordinates (free,) [-] of the values of this fit by other centres and scales; 0 of what it lacks."""
        values = {p.row: float(value) for p, value in zip(self.free, values_of(self.free, self.z), strict=True)}
        return np.array([p.coordinate(values[p.row]) if p.row in values else 0.0 for p in free])

    def resolutions(self, columns: Array) -> dict[str, float]:
        """Standard deviation [SI] of each free parameter while all others keep their values, by key.

        columns: (rows,) the parameter set of z (JointProblem.columns).  A change by a tenth of it changes no
        prediction noticeably, however the parameters are correlated.
        """
        deviations = 1.0 / np.sqrt(np.diag(self.normal) + 1.0)
        return {
            parameter.key: parameter.deviation(float(columns[parameter.row]), float(deviation))
            for parameter, deviation in zip(self.free, deviations, strict=True)
            if parameter.row < START_CREEP and not parameter.is_fixed
        }


def start_at(free: Sequence[FreeParameter], known: Mapping[int, float]) -> Array:
    """Coordinates (free,) [-] to start from: the known ones by row, 0 for the others."""
    return np.array([known.get(parameter.row, 0.0) for parameter in free])


def map_fit(
    problem: JointProblem,
    free: Sequence[FreeParameter],
    start: Array,
    iterations: int = FITS.iterations,
    tolerance: float = FITS.tolerance,
    *,
    difference: float = FITS.difference,
) -> MapFit:
    """Fit from start (free,). Stops when the cost [-] falls by less than `tolerance`, or a small part of itself.

    difference: step of the finite differences, in prior standard deviations; a wide one sees past the small steps that
    sticking and stops make in the cost.
    """
    bounds = bounds_of(free)
    here, sensitivity = _begun(problem, free, np.clip(start, *bounds), bounds[1], difference)
    for done in range(1, iterations + 1):
        if done > 1:
            sensitivity = []  # of ten minutes two of them would be large
            sensitivity = residual_slopes(problem, free, here, bounds[1], difference)
        normal, slope = normal_equations(problem, here.residuals, sensitivity)
        if done == iterations:
            break
        trials = _trial_steps(here.z, normal, slope, bounds)
        costs, squares, residuals = _simulated(problem, free, trials)
        best = int(np.argmin(costs))
        if not costs[best] < here.cost - max(tolerance, FITS.relative_tolerance * here.cost):
            break
        here = Point(trials[best], float(costs[best]), squares[best], [r[best].copy() for r in residuals])
    return MapFit(
        free=tuple(free),
        z=here.z,
        cost=here.cost,
        squares=here.squares,
        residuals=tuple(here.residuals),
        normal=normal,
        sensitivity=tuple(sensitivity),
        iterations=done,
    )


def with_slopes(problem: JointProblem, fit: MapFit) -> MapFit:
    """A fit with the slopes of its residuals, computed again where they were not kept."""
    return fit if fit.sensitivity or not fit.free else map_fit(problem, fit.free, fit.z, 1)


def point_at(problem: JointProblem, free: Sequence[FreeParameter], z: Array) -> Point:
    """The point of coordinates z (free,) [-]."""
    costs, squares, residuals = _simulated(problem, free, z[None])
    return Point(z, float(costs[0]), squares[0], [r[0] for r in residuals])


@dataclass(frozen=True, slots=True)
class Point:
    """Coordinates z (free,), their cost, squares (OUTPUTS, blocks) and residuals (OUTPUTS, T) by segment."""

    z: Array
    cost: float
    squares: Array
    residuals: list[Array]


def usable_point(problem: JointProblem, free: Sequence[FreeParameter], z: Array) -> Point:
    """The start z (free,) [-], or the farthest point towards it from the mode of the prior that can be simulated."""
    for share in FITS.fallback_shares:
        point = point_at(problem, free, share * z)
        if np.isfinite(point.cost):
            break
    return point


def _begun(
    problem: JointProblem, free: Sequence[FreeParameter], z: Array, high: Array, difference: float
) -> tuple[Point, list[Array]]:
    """The point to start from and `residual_slopes` there, by one simulation where z (free,) [-] can be simulated."""
    steps = _differences(z, high, difference)
    costs, squares, residuals = _simulated(problem, free, np.vstack([z, z + np.diag(steps)]))
    if not np.isfinite(costs[0]):
        here = usable_point(problem, free, z)
        return here, residual_slopes(problem, free, here, high, difference)
    here = Point(z, float(costs[0]), squares[0], [each[0].copy() for each in residuals])
    return here, _slopes([each[1:] for each in residuals], here, steps)


def multi_start(
    problem: JointProblem,
    free: Sequence[FreeParameter],
    starts: Sequence[Array],
    first: int = FITS.first_iterations,
    iterations: int = FITS.last_iterations,
) -> MapFit:
    """Fit briefly from every start (free,) [-], then to the end from the two best: there are local minima."""
    tried = sorted((map_fit(problem, free, start, first) for start in starts), key=lambda fit: fit.cost)
    ended = [map_fit(problem, free, fit.z, iterations) for fit in tried[:2]]
    return min(ended, key=lambda fit: fit.cost)


def bounds_of(free: Sequence[FreeParameter]) -> tuple[Array, Array]:
    """Least and largest coordinates (free,) [-] each."""
    most = FITS.max_coordinate
    low = np.array([max(p.coordinate(p.low), -most) if _reachable(p, p.low) else -most for p in free])
    high = np.array([min(p.coordinate(p.high), most) for p in free])
    return low, high


def _reachable(parameter: FreeParameter, value: float) -> bool:
    return not parameter.log or value > 0.0


def residual_slopes(
    problem: JointProblem, free: Sequence[FreeParameter], here: Point, high: Array, difference: float
) -> list[Array]:
    """Slopes of the residuals (free, OUTPUTS, T) by segment [SI per coordinate], from forward differences.

    high: largest coordinates (free,) [-].  difference: step of the coordinates [-].
    """
    if not free:
        return [np.zeros((0, *residual.shape)) for residual in here.residuals]
    steps = _differences(here.z, high, difference)
    return _slopes(problem.residuals(*problem.columns(free, here.z[None] + np.diag(steps))), here, steps)


def _differences(z: Array, high: Array, difference: float) -> Array:
    """Steps (free,) [-] of the coordinates z (free,) that stay below the largest ones, high (free,)."""
    return np.where(z + difference > high, -difference, difference)


def _slopes(moved: Sequence[Array], here: Point, steps: Array) -> list[Array]:
    """Slopes of residuals that were moved (free, OUTPUTS, T) by steps (free,) [-], by segment; overwrites them."""
    for slopes, residual in zip(moved, here.residuals, strict=True):
        slopes -= residual  # in place: of ten minutes these arrays are large
        slopes /= steps[:, None, None]
    return list(moved)


def normal_equations(
    problem: JointProblem, residuals: Sequence[Array], sensitivity: Sequence[Array]
) -> tuple[Array, Array]:
    """J' W J (free, free) and J' W r (free,) of the training data, without priors.

    Both [-].  residuals: (OUTPUTS, T) by segment, SI.  sensitivity: their slopes (free, OUTPUTS, T) by segment, SI.
    """
    train = (~problem.validation).astype(float)
    count = len(sensitivity[0])
    normal, slope = np.zeros((count, count)), np.zeros(count)
    for segment, residual, slopes in zip(problem.segments, residuals, sensitivity, strict=True):
        counted = train[segment.block]
        for stage in np.flatnonzero(segment.use.any(axis=1)):  # stage by stage: smaller arrays
            root = segment.trust * np.sqrt(problem.weight[stage]) * counted
            j = slopes[:, stage] * root
            normal += j @ j.T
            slope += j @ (residual[stage] * root)
    return normal, slope


def _trial_steps(z: Array, normal: Array, slope: Array, bounds: tuple[Array, Array]) -> Array:
    gradient = slope + z
    hessian = normal + np.eye(len(z))
    scale = np.diag(np.diag(hessian))
    trials = []
    for damping, longest in FITS.trials:
        low, high = np.maximum(bounds[0] - z, -longest), np.minimum(bounds[1] - z, longest)
        trials.append(z + bounded_step(hessian + damping * scale, gradient, low, high))
    return np.array(trials)


def bounded_step(hessian: Array, gradient: Array, low: Array, high: Array) -> Array:
    """The step (free,) [-] to the minimum of the quadratic model within a box; few coordinates are at its sides.

    hessian: (free, free) [-].  gradient, low, high: (free,) [-].
    Coordinates that would leave the box stay at its side until the slope there points back into it (active set method,
    Nocedal and Wright 2006, Sec. 16.5).
    """
    if not (np.isfinite(hessian).all() and np.isfinite(gradient).all()):
        return np.full(len(gradient), np.nan)
    arrays = (np.ascontiguousarray(array, dtype=np.float64) for array in (hessian, gradient, low, high))
    return np.asarray(_active_set(*arrays))


@njit(cache=True, error_model="numpy")
def _solve(matrix, right):  # type: ignore[no-untyped-def]
    """Solve for a symmetric positive definite matrix (n, n), in place: both are overwritten, `right` by the solution.

    Cholesky's method (Golub and Van Loan 2013, Sec. 4.2). To compile numpy.linalg.solve would take a first start 8 s.
    """
    count = len(right)
    for j in range(count):
        for k in range(j):
            right[j] -= matrix[j, k] * right[k]
            matrix[j, j] -= matrix[j, k] ** 2
        matrix[j, j] = np.sqrt(matrix[j, j])
        right[j] /= matrix[j, j]
        for i in range(j + 1, count):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] /= matrix[j, j]
    for j in range(count - 1, -1, -1):
        for i in range(j + 1, count):
            right[j] -= matrix[i, j] * right[i]
        right[j] /= matrix[j, j]


@njit(cache=True, error_model="numpy")
def _active_set(hessian, gradient, low, high):  # type: ignore[no-untyped-def]
    """The step of `bounded_step`, compiled: a fit that meets bounds solves dozens of small systems for each step."""
    count = len(gradient)
    step, free = np.minimum(np.maximum(np.zeros(count), low), high), np.ones(count, dtype=np.bool_)
    for _ in range(2 * count):
        inner, left = np.flatnonzero(free), False
        if len(inner) > 0:
            matrix, toward = np.empty((len(inner), len(inner))), np.empty(len(inner))
            for row, i in enumerate(inner):
                at_sides = 0.0
                for j in range(count):
                    at_sides += 0.0 if free[j] else hessian[i, j] * step[j]
                for column, k in enumerate(inner):
                    matrix[row, column] = hessian[i, k]
                toward[row] = -gradient[i] - at_sides
            _solve(matrix, toward)
            for i, inside in zip(inner, toward):  # noqa: B905 - numba's zip is never strict
                step[i] = min(max(inside, low[i]), high[i])
                if step[i] != inside:
                    free[i], left = False, True
        if left:
            continue
        back = False
        slope = gradient + hessian @ step
        for j in range(count):
            inward = (step[j] <= low[j] and slope[j] < 0.0) or (step[j] >= high[j] and slope[j] > 0.0)
            if not free[j] and inward and low[j] < high[j]:
                free[j], back = True, True
        if not back:
            break
    return step


def costs_at(problem: JointProblem, free: Sequence[FreeParameter], points: Array) -> Array:
    """Costs (k,) [nats] at coordinates (k, free), infinite where the simulation is.

    Some at a time, because the residuals of all of them would fill the memory for a long recording.
    """
    parts = [points[k : k + AT_ONCE] for k in range(0, len(points), AT_ONCE)]
    return np.concatenate([_simulated(problem, free, part)[0] for part in parts]) if parts else np.zeros(0)


def _simulated(problem: JointProblem, free: Sequence[FreeParameter], points: Array) -> tuple[Array, Array, list[Array]]:
    """Costs (k,), squares (k, OUTPUTS, blocks) and residuals (k, OUTPUTS, T) by segment."""
    residuals = problem.residuals(*problem.columns(free, points))
    squares = problem.block_squares(residuals)
    counted = np.where(problem.validation, 0.0, squares)  # of a simulation that diverges, squares are infinite
    costs: Array = (problem.block_weights[None] * counted).sum(axis=(1, 2)) + (points**2).sum(axis=1)
    return np.where(costs < FITS.diverged, costs, np.inf), squares, residuals


def residual_is_correlated(problem: JointProblem, fit: MapFit, ratio: float) -> bool:
    """Whether the RMS of any residual is more than `ratio` [-] times its white noise."""
    for segment, residual in zip(problem.segments, fit.residuals, strict=True):
        for stage in np.flatnonzero(segment.use.any(axis=1)):
            left = residual[stage][segment.use[stage]]
            if float(np.sqrt(np.mean(left**2))) > ratio * segment.white_noise(int(stage), left):
                return True
    return False


def correlation_s(problem: JointProblem, fit: MapFit) -> float:
    """Distance [s] of samples of the residuals of a fit that count as independent, at most FITS.correlation_s.

    The integrated autocorrelation time, up to the first lag at which nothing is correlated (Sokal, Monte Carlo methods
    in statistical mechanics, 1997), of the signal in which it is longest. What the model lacks lengthens it.
    """
    longest = 0.0
    for segment, residual in zip(problem.segments, fit.residuals, strict=True):
        lags = min(round(FITS.correlation_s / segment.period_s), int(FITS.max_lag_share * len(segment.angle_rad)))
        for stage in np.flatnonzero(segment.use.any(axis=1)):
            left = np.where(segment.use[stage], residual[stage], 0.0)
            power = float(left @ left)
            alike = np.array([float(left[lag:] @ left[: len(left) - lag]) for lag in range(1, lags + 1)])
            if power > 0.0:
                end = int(np.argmax(np.r_[alike < FITS.uncorrelated * power, True]))
                longest = max(longest, segment.period_s * (1.0 + 2.0 * float(alike[:end].sum()) / power))
    return min(longest, FITS.correlation_s) or FITS.correlation_s
