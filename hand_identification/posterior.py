"""The posterior of a fit's coordinates as a normal distribution: inverse and determinant of its precision."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

from hand_model.arrays import Array

_GROWTH = 100.0
"""Factor from one trial to raise the diagonal to the next."""


def posterior_of(precision: Array) -> tuple[Array, float]:
    """Covariance (k, k) [-] and log determinant of a symmetric precision (k, k) [-].

    By Cholesky's factor of the matrix with a diagonal of ones, which is nearly the best scaling of rows and columns
    (van der Sluis, Numer. Math. 14, 1969). Where a small change of a number almost lets a simulation diverge, entries
    are so large that the matrix rounds to a singular or an indefinite one; its diagonal is then raised from the
    rounding error on. One that is not finite leaves nothing open: zeros, and infinity.
    """
    if not np.isfinite(precision).all():
        return np.zeros_like(precision), np.inf
    rounding = len(precision) * np.finfo(np.float64).eps
    diagonal = np.diag(precision)
    lost = rounding * np.max(np.abs(diagonal), initial=0.0)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, lost))
    factor = _factor(precision * scale * scale[:, None], rounding)
    root = solve_triangular(factor, np.diag(scale), lower=True, check_finite=False)
    return np.asarray(root.T @ root), float(2.0 * (np.log(np.diag(factor)) - np.log(scale)).sum())


def _factor(matrix: Array, rounding: float) -> Array:
    """Cholesky's factor (k, k) of a matrix with a diagonal of ones, raised where it is not positive definite.

    Raised by the sum of all entries it is, by Gershgorin's theorem. Raises LinAlgError where they are not finite.
    """
    raised, most = 0.0, _GROWTH * float(np.abs(matrix).sum())
    while raised <= most < np.inf:
        try:
            return np.asarray(np.linalg.cholesky(matrix + raised * np.eye(len(matrix))))
        except np.linalg.LinAlgError:
            raised = max(_GROWTH * raised, rounding)
    raise np.linalg.LinAlgError("the precision of a fit has no finite scale")


def covariance_of(normal: Array, factor: float = 1.0) -> Array:
    """Covariance (free, free) [-] of coordinates with a unit prior, whose data have the normal matrix (free, free).

    factor: of the data's information [-].
    """
    return posterior_of(np.eye(len(normal)) + factor * normal)[0]
