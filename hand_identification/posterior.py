"""The posterior of a fit's coordinates as a normal distribution: inverse and determinant of its precision."""

from __future__ import annotations

import numpy as np

from hand_model.arrays import Array


def posterior_of(precision: Array) -> tuple[Array, float]:
    """Covariance (k, k) [-] and log determinant of a symmetric precision (k, k) [-].

    By the eigenvalues of the matrix with a diagonal of ones, none below its rounding error: where a small change of a
    number almost lets a simulation diverge, entries are so large that the matrix rounds to a singular or an indefinite
    one. Nearly the best scaling of rows and columns is that diagonal (van der Sluis, Numer. Math. 14, 1969). One that
    is not finite leaves nothing open: zeros, and infinity.
    """
    if not np.isfinite(precision).all():
        return np.zeros_like(precision), np.inf
    rounding = len(precision) * np.finfo(np.float64).eps
    diagonal = np.diag(precision)
    lost = rounding * np.max(np.abs(diagonal), initial=0.0)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, lost))
    values, vectors = np.linalg.eigh(precision * scale * scale[:, None])
    values = np.maximum(values, rounding)
    root = scale[:, None] * vectors / np.sqrt(values)
    return np.asarray(root @ root.T), float(np.log(values).sum() - 2.0 * np.log(scale).sum())


def covariance_of(normal: Array, factor: float = 1.0) -> Array:
    """Covariance (free, free) [-] of coordinates with a unit prior, whose data have the normal matrix (free, free).

    factor: of the data's information [-].
    """
    return posterior_of(np.eye(len(normal)) + factor * normal)[0]
