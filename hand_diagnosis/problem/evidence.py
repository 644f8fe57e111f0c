"""Evidence of a fit: its likelihood and Laplace's approximation, its errors on validation data and their scatter.

The scale of the correlated noise is not known beforehand, only its floor (FITS.floor). With n independent
samples of a signal and the weighted sum of squares chi2, log p = -n/2 log(1 + chi2 / n): a parabola near the floor, and
a logarithm far above it, where no model fits and differences of squares overstate what is known. The white noise of
the readings is known, and hardly anything of it is left in the mean over one independent sample: its squares do not
count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit
from hand_identification.posterior import posterior_of
from hand_identification.shared_fit import SharedFit
from hand_model.arrays import Array, Flags


def log_likelihood(problem: JointProblem, squares: Array, blocks: Flags) -> float:
    """Log likelihood of the blocks chosen (blocks,), from sums of squares (OUTPUTS, blocks) in SI."""
    counts = np.maximum(problem.effective_counts(blocks), 1.0)
    return float(-0.5 * (counts * np.log1p(_misfit(problem, squares, blocks) / counts)).sum())


def _misfit(problem: JointProblem, squares: Array, blocks: Flags) -> Array:
    """Weighted sums (OUTPUTS,) [-] of squares (OUTPUTS, blocks) [SI] in the blocks chosen, without white noise."""
    total: Array = (problem.block_weights * squares)[:, blocks].sum(axis=1)
    return np.maximum(total - white_squares(problem, blocks), 0.0)


def white_squares(problem: JointProblem, blocks: Flags | None = None) -> Array:
    """Weighted squares (OUTPUTS,) [-] of the white noise (JointProblem.white) in all blocks or those chosen (blocks,).

    0 where it is not left out.
    """
    if problem.white is None:
        return np.zeros(len(problem.weight))
    squares = problem.block_weights * problem.white[:, : problem.blocks] ** 2 * problem.block_counts
    return np.asarray(squares[:, slice(None) if blocks is None else blocks].sum(axis=1))


def log_evidence(problem: JointProblem, fit: MapFit, optional: Sequence[Sequence[int]] = ()) -> float:
    """Log evidence [nats] of a fit by Laplace's approximation, training and validation blocks together.

    The likelihood of the validation blocks at the point fitted without them is added: p(all) = p(train) p(val | train).
    optional: for each effect, indices of free parameters of which each may be needed or not. The evidence is the mean
    over these models; each follows from the full one by the ratio of posterior to prior density at the neutral values
    (Dickey, Ann. Math. Stat. 42(1), 1971), effects taken one by one: a number that is not needed costs nothing.
    A fit at which a small change of a number lets the simulation diverge has none: -inf.
    """
    covariance, logdet = posterior_of(np.eye(len(fit.z)) + shrunk(problem, fit) * fit.normal)
    if logdet == np.inf:
        return -np.inf
    whole = _fitted_likelihood(problem, fit.squares) + _laplace(fit.z, logdet)
    return whole + sum(_mean_over_subsets(fit.z, covariance, group) for group in optional)


def shared_log_evidence(
    problems: Sequence[JointProblem],
    found: SharedFit,
    optional: Sequence[Sequence[Sequence[int]]],
    optional_shared: Sequence[Sequence[int]] = (),
) -> float:
    """Log evidence [nats] of joints that share coordinates, as `log_evidence`: each prior and factor counts once.

    optional: of each joint, indices of its private free parameters.  optional_shared: indices of the shared ones.
    """
    count = len(found.shared)
    shrink = [shrunk(problem, fit) for problem, fit in zip(problems, found.fits, strict=True)]
    if not all(np.isfinite(factor * fit.normal).all() for factor, fit in zip(shrink, found.fits, strict=True)):
        return -np.inf
    total = 0.0
    for problem, fit, groups, factor in zip(problems, found.fits, optional, shrink, strict=True):
        private = len(fit.z) - count
        precision = np.eye(private) + factor * fit.normal[:private, :private]
        covariance, logdet = posterior_of(precision)
        total += _fitted_likelihood(problem, fit.squares) + _laplace(fit.z[:private], logdet)
        total += sum(_mean_over_subsets(fit.z[:private], covariance, group) for group in groups)
    covariance, logdet = posterior_of(found.precision(shrink))
    total += _laplace(found.z, logdet)
    return total + sum(_mean_over_subsets(found.z, covariance, group) for group in optional_shared)


def shrunk(problem: JointProblem, fit: MapFit) -> float:
    """Factor [-] of the curvature of a fit: far above the floor the noise is larger than its weight says."""
    train = ~problem.validation
    counts = np.maximum(problem.effective_counts(train), 1.0)
    return float(counts.sum() / (counts.sum() + _misfit(problem, fit.squares, train).sum()))


def most_to_gain(problem: JointProblem, fit: MapFit, known: MapFit | None = None) -> float:
    """Log likelihood [nats] by which a model that leaves nothing but white noise would surpass a fit, at least 0.

    known: a fit with residuals, which show the noise; by default the fit itself.
    """
    noise = white_parts(problem, known or fit)[:, None] ** 2 * problem.block_counts
    best = fit.squares.copy()
    for part in (problem.validation, ~problem.validation):  # single blocks have less than their noise by chance
        total, least = (squares[:, part].sum(axis=1) for squares in (fit.squares, noise))
        best[:, part] *= np.minimum(least / np.maximum(total, 1e-300), 1.0)[:, None]
    return _fitted_likelihood(problem, best) - _fitted_likelihood(problem, fit.squares)


def likelihood_at_most(problem: JointProblem, fit: MapFit, part: JointProblem, squares: Array) -> float:
    """Log likelihood [nats] of a model with these squares in a part of the data, and no more than noise in the rest.

    fit: of the whole problem; what it leaves is the limit in the rest, too, and shows the noise.  part: the problem in
    which the samples of that part alone count.  squares: (OUTPUTS, blocks) SI of the model there.
    """
    of_fit = part.block_squares(part.residuals(*part.columns(fit.free, fit.z[None])))[0]
    noise = white_parts(problem, fit)[:, None] ** 2 * (problem.block_counts - part.block_counts)
    return _fitted_likelihood(problem, squares + np.minimum(np.maximum(fit.squares - of_fit, 0.0), noise))


def _fitted_likelihood(problem: JointProblem, squares: Array) -> float:
    """Log likelihood of training and validation blocks, from squares (OUTPUTS, blocks): p(train) p(val | train)."""
    train = ~problem.validation
    return log_likelihood(problem, squares, train) + log_likelihood(problem, squares, ~train)


def _laplace(z: Array, logdet: float) -> float:
    """Log of prior density over posterior density at the best point z (k,). logdet: of the posterior's precision."""
    return -0.5 * float(z @ z) - 0.5 * logdet


def _mean_over_subsets(z: Array, covariance: Array, optional: Sequence[int]) -> float:
    """Log of the mean evidence of the models without some of the optional parameters, over that of the full one."""
    off = [list(chosen) for k in range(len(optional)) for chosen in combinations(optional, k)]
    ratios = np.array([_density_ratio(z[chosen], covariance[np.ix_(chosen, chosen)]) for chosen in off])
    return float(np.logaddexp.reduce(ratios) - np.log(len(ratios)))


def _density_ratio(z: Array, covariance: Array) -> float:
    """Log of posterior over prior density at the neutral point, of coordinates (k,) with a unit prior around it."""
    precision, logdet = posterior_of(covariance)
    return -0.5 * float(z @ precision @ z) - 0.5 * logdet


def validation_rmse(problem: JointProblem, squares: Array) -> Array:
    """RMS error (OUTPUTS,) [Pa, rad, N] over the validation blocks from squares (OUTPUTS, blocks); NaN without data."""
    held = problem.validation
    counts = problem.block_counts[:, held].sum(axis=1)
    return np.sqrt(np.where(counts > 0, squares[:, held].sum(axis=1) / np.maximum(counts, 1), np.nan))


def fitted_rmse(problem: JointProblem, squares: Array) -> Array:
    """RMS error (OUTPUTS,) [Pa, rad, N] over training and validation blocks together, as `validation_rmse`."""
    counts = problem.block_counts.sum(axis=1)
    return np.sqrt(np.where(counts > 0, squares.sum(axis=1) / np.maximum(counts, 1), np.nan))


def block_bootstrap(
    problem: JointProblem, before: Array, after: Array, stage: int, rng: np.random.Generator
) -> tuple[float, float]:
    """95 % interval of the relative fall [-] of the validation mean square, by drawing validation blocks in pairs.

    before, after: sums of squares (OUTPUTS, blocks).
    """
    held = np.flatnonzero(problem.validation & (problem.block_counts[stage] > 0))
    if len(held) < 2:
        return -np.inf, np.inf
    drawn = rng.choice(held, size=(SETTINGS.bootstrap_draws, len(held)))
    a, b = before[stage][drawn].sum(axis=1), after[stage][drawn].sum(axis=1)
    fall = 1.0 - b / np.maximum(a, 1e-300)
    low, high = np.quantile(fall, [SETTINGS.bootstrap_tail, 1.0 - SETTINGS.bootstrap_tail])
    return float(low), float(high)


def white_parts(problem: JointProblem, fit: MapFit) -> Array:
    """The white part of the residual of each signal (OUTPUTS,) [SI]; 0 where there is none."""
    found = np.zeros(len(problem.weight))
    for segment, residual in zip(problem.segments, fit.residuals, strict=True):
        for stage, (values, use) in enumerate(zip(residual, segment.use, strict=True)):
            if use.sum() > SETTINGS.min_stage_samples:
                found[stage] = max(found[stage], segment.white_noise(stage, values[use]))
    return found


def likelihood_below_floor(problem: JointProblem, known: MapFit, fit: MapFit) -> float:
    """Log likelihood [nats] of the validation data by a fit, as `log_likelihood`, against white noise instead of the
    floor.

    known: the fit whose residuals show the noise, the same for all fits that are compared.
    """
    counts = problem.effective_counts(problem.validation)
    rmse = np.nan_to_num(validation_rmse(problem, fit.squares))
    noise = white_parts(problem, known)
    noise[noise == 0.0] = np.inf
    return float(-0.5 * (counts * np.log1p((rmse / noise) ** 2)).sum())


def weighted_by_noise(problem: JointProblem, fit: MapFit) -> JointProblem:
    """The problem with the weights of the white noise that a fit leaves, up to SETTINGS.refit_weight times its own."""
    weight = SETTINGS.refit_weight * problem.weight
    for stage, noise in enumerate(white_parts(problem, fit)):
        if noise > 0.0:
            weight[stage] = max(min(weight[stage], 1.0 / noise**2), problem.weight[stage])
    return replace(problem, weight=weight, white=None)


def weighted_by_rest(problem: JointProblem, fit: MapFit) -> JointProblem:
    """The problem with the weights of all that a fit leaves, where this is more than its own weights say.

    A model is never exact. What it cannot describe is no white noise, and with weights of that alone numbers that the
    data hardly determine, such as a common scale of all forces, would go far from their prior for the sake of it.
    """
    left = fitted_rmse(problem, fit.squares) ** 2
    return replace(problem, weight=np.fmin(problem.weight, 1.0 / np.maximum(left, 1e-300)))
