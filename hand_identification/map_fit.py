"""Maximum a posteriori fit of a joint by simulation error: damped Gauss-Newton, all columns as lanes of one rollout."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hand_identification.free_parameters import Move
from hand_identification.joint_problem import JointProblem
from hand_model.arrays import Array

DIFFERENCE = 0.002
"""Step of the finite differences, in standard deviations of the prior."""
DAMPING = (0.0, 1e-2, 0.1, 1.0, 30.0)
BOLD = (0.0, 0.1, 30.0)
"""Trial steps, all tried at once, by their damping; bold ones may be longer.  Eight fill two blocks of lanes."""
LONGEST_STEP, LONGEST_BOLD = 0.7, 4.0
"""Of any coordinate: beyond a prior's width the slopes say little, but where they do, the way is short."""


@dataclass(frozen=True, slots=True)
class MapFit:
    """The best point: coordinates z (moves,), cost, squares (OUTPUTS, blocks), residuals by piece, curvature.

    normal: (moves, moves), J' W J of the data alone.  cost: weighted train squares + z' z.
    """

    moves: tuple[Move, ...]
    z: Array
    cost: float
    squares: Array
    residuals: tuple[Array, ...]
    normal: Array
    sensitivity: tuple[Array, ...]
    iterations: int

    def lean(self) -> MapFit:
        """The same without the large arrays: what a hypothesis that was not taken needs to be reported."""
        return replace(self, residuals=(), sensitivity=())

    @property
    def covariance(self) -> Array:
        """Of z, prior included, (moves, moves)."""
        return np.asarray(np.linalg.inv(self.normal + np.eye(len(self.z))), dtype=np.float64)


def map_fit(
    problem: JointProblem, moves: Sequence[Move], start: Array, iterations: int = 12, tolerance: float = 0.02
) -> MapFit:
    """Fit from start (moves,). Stops when the cost falls by less than `tolerance` of a unit (or 1e-4 of itself)."""
    bounds = _bounds(moves)
    here = _usable(problem, moves, np.clip(start, *bounds))
    for done in range(1, iterations + 1):
        sensitivity = _slopes(problem, moves, here, bounds[1])
        normal, slope = _normal_equations(problem, here.residuals, sensitivity)
        if done == iterations:
            break
        trials = _trial_steps(here.z, normal, slope, bounds)
        costs, squares, residuals = _simulated(problem, moves, trials)
        best = int(np.argmin(costs))
        if not costs[best] < here.cost - max(tolerance, 1e-4 * here.cost):
            break
        here = _Point(trials[best], float(costs[best]), squares[best], [r[best].copy() for r in residuals])
    return MapFit(
        tuple(moves), here.z, here.cost, here.squares, tuple(here.residuals), normal, tuple(sensitivity), done
    )


@dataclass(frozen=True, slots=True)
class _Point:
    """Coordinates z (moves,), their cost, squares (OUTPUTS, blocks) and residuals (OUTPUTS, T) by piece."""

    z: Array
    cost: float
    squares: Array
    residuals: list[Array]


def _usable(problem: JointProblem, moves: Sequence[Move], z: Array) -> _Point:
    """The start, or as far from the nominal values towards it as the simulation stays finite."""
    for share in (1.0, 0.9, 0.7, 0.5, 0.3, 0.1, 0.0):
        costs, squares, residuals = _simulated(problem, moves, (share * z)[None])
        if np.isfinite(costs[0]):
            break
    return _Point(share * z, float(costs[0]), squares[0], [r[0] for r in residuals])


def multi_start(
    problem: JointProblem, moves: Sequence[Move], starts: Sequence[Array], first: int = 4, iterations: int = 25
) -> MapFit:
    """Fit briefly from every start, then to the end from the two best: simulation error has local minima."""
    tried = sorted((map_fit(problem, moves, start, first) for start in starts), key=lambda fit: fit.cost)
    ended = [map_fit(problem, moves, fit.z, iterations) for fit in tried[:2]]
    return min(ended, key=lambda fit: fit.cost)


def _bounds(moves: Sequence[Move]) -> tuple[Array, Array]:
    low = np.array([max(move.coordinate(move.low), -8.0) if _reachable(move, move.low) else -8.0 for move in moves])
    high = np.array([min(move.coordinate(move.high), 8.0) for move in moves])
    return low, high


def _reachable(move: Move, value: float) -> bool:
    return not move.log or value > 0.0


def _slopes(problem: JointProblem, moves: Sequence[Move], here: _Point, high: Array) -> list[Array]:
    """Of the residuals (moves, OUTPUTS, T) by piece."""
    steps = np.where(here.z + DIFFERENCE > high, -DIFFERENCE, DIFFERENCE)
    sensitivity = problem.residuals(*problem.columns(moves, here.z[None] + np.diag(steps)))
    for slopes, residual in zip(sensitivity, here.residuals, strict=True):
        slopes -= residual  # in place: of ten minutes these arrays are large
        slopes /= steps[:, None, None]
    return sensitivity


def _normal_equations(
    problem: JointProblem, residuals: Sequence[Array], sensitivity: Sequence[Array]
) -> tuple[Array, Array]:
    train = (~problem.held_out).astype(float)
    count = len(sensitivity[0])
    normal, slope = np.zeros((count, count)), np.zeros(count)
    for piece, residual, slopes in zip(problem.pieces, residuals, sensitivity, strict=True):
        counted = train[piece.block]
        for stage in np.flatnonzero(piece.use.any(axis=1)):  # stage by stage: smaller arrays
            root = np.sqrt(problem.weight[stage]) * counted
            j = slopes[:, stage] * root
            normal += j @ j.T
            slope += j @ (residual[stage] * root)
    return normal, slope


def _trial_steps(z: Array, normal: Array, slope: Array, bounds: tuple[Array, Array]) -> Array:
    gradient = slope + z
    hessian = normal + np.eye(len(z))
    scale = np.diag(np.diag(hessian))
    trials = []
    limits = [(damping, LONGEST_STEP) for damping in DAMPING] + [(damping, LONGEST_BOLD) for damping in BOLD]
    for damping, longest in limits:
        step = _bounded_step(hessian + damping * scale, gradient, bounds[0] - z, bounds[1] - z)
        step *= min(1.0, longest / max(float(np.abs(step).max()), 1e-300))
        trials.append(z + step)
    return np.array(trials)


def _bounded_step(hessian: Array, gradient: Array, low: Array, high: Array) -> Array:
    """The step to the minimum of the parabola, coordinates that would leave their bounds held there."""
    step = np.clip(np.zeros(len(gradient)), low, high)
    free = np.ones(len(gradient), dtype=bool)
    for _ in range(len(gradient)):
        rest = gradient[free] + hessian[np.ix_(free, ~free)] @ step[~free]
        inside = np.linalg.solve(hessian[np.ix_(free, free)], -rest)
        step[free] = np.clip(inside, low[free], high[free])
        left = step[free] != inside
        if not left.any():
            break
        free[np.flatnonzero(free)[left]] = False
        if not free.any():
            break
    return step


def costs_at(problem: JointProblem, moves: Sequence[Move], points: Array) -> Array:
    """Costs (k,) at coordinates (k, moves), simulated together; infinite where the simulation is."""
    return _simulated(problem, moves, points)[0]


def _simulated(problem: JointProblem, moves: Sequence[Move], points: Array) -> tuple[Array, Array, list[Array]]:
    """Costs (k,), squares (k, OUTPUTS, blocks) and residuals (k, OUTPUTS, T) by piece."""
    train = (~problem.held_out).astype(float)
    residuals = problem.residuals(*problem.columns(moves, points))
    squares = problem.block_squares(residuals)
    costs: Array = (problem.weight[None, :, None] * squares * train).sum(axis=(1, 2)) + (points**2).sum(axis=1)
    return np.where(np.isfinite(costs), costs, np.inf), squares, residuals
