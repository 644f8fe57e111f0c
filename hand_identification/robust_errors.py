"""Standard errors of a fit whose residuals are not independent from sample to sample.

The usual errors assume a number of independent samples. A misfit is not one: a number would have to follow it in one
stretch and cannot in another. The errors here assume only that groups of blocks are independent of each other, whatever
happens within a group (Liang and Zeger, Biometrika 73(1), 1986); the largest over several sizes of group counts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit
from hand_identification.settings import FITS
from hand_model.arrays import Array


def robust_errors(problem: JointProblem, fit: MapFit) -> Array:
    """Standard errors (free,) [-] of the coordinates of a fit to all blocks of a problem; 0 without its sensitivity."""
    if not fit.sensitivity or not len(fit.z):
        return np.zeros(len(fit.z))
    bread, scores = fit.covariance, _scores(problem, fit)
    found = [_errors(bread, scores, groups) for groups in _groups(problem)]
    return np.asarray(np.max(found, axis=0)) if found else np.zeros(len(fit.z))


def _scores(problem: JointProblem, fit: MapFit) -> Array:
    """Gradient (blocks, free) of half the cost of the data, by block."""
    total = np.zeros((problem.blocks, len(fit.z)))
    for segment, residual, slopes in zip(problem.segments, fit.residuals, fit.sensitivity, strict=True):
        first, last = int(segment.block[0]), int(segment.block[-1])
        starts = np.searchsorted(segment.block, np.arange(first, last + 1))
        product = np.einsum("fst,st,s->ft", slopes, residual, segment.trust**2 * problem.weight)
        total[first : last + 1] += np.add.reduceat(product, starts, axis=1).T
    return total


def _groups(problem: JointProblem) -> list[NDArray[np.int64]]:
    """Number (blocks,) of the group of each block, for each size of group that leaves enough of them."""
    recording = np.zeros(problem.blocks, dtype=np.int64)
    for number, segment in enumerate(problem.segments):
        recording[segment.block] = number
    numbers = np.arange(problem.blocks, dtype=np.int64)
    sizes: Sequence[NDArray[np.int64]] = [*(numbers // size for size in FITS.error_group_blocks), recording]
    return [groups for groups in sizes if len(np.unique(groups)) >= FITS.least_error_groups]


def _errors(bread: Array, scores: Array, groups: NDArray[np.int64]) -> Array:
    """Standard errors (free,) by the scatter of the groups. bread: (free, free).  scores: (blocks, free)."""
    names, number = np.unique(groups, return_inverse=True)
    summed = np.zeros((len(names), scores.shape[1]))
    np.add.at(summed, number, scores)
    moved = summed @ bread
    return np.asarray(np.sqrt((moved**2).sum(axis=0) * len(names) / (len(names) - 1)))
