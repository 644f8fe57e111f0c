"""Standard errors that residuals which are not independent cannot make too small."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hand_identification.map_fit import MapFit
from hand_identification.robust_errors import robust_errors
from hand_model.kernel.open_loop import OUTPUTS

SAMPLES, BLOCK, DRAWS = 3000, 50, 200


@dataclass
class Part:
    """Blocks of one recording."""

    block: np.ndarray
    trust: float = 1.0


@dataclass
class Line:
    """A straight line through measured values as a problem. weight (OUTPUTS,)."""

    segments: list[Part]
    weight: np.ndarray
    blocks: int


def fitted(noise: np.ndarray) -> tuple[Any, MapFit]:
    """A line fitted by least squares to values that are nothing but noise; the prior is wide."""
    design = np.array([np.ones(SAMPLES), np.linspace(-1.0, 1.0, SAMPLES)])
    normal = 1e4 * design @ design.T
    z = np.linalg.solve(normal, 1e4 * design @ noise)
    residual, slopes = np.zeros((OUTPUTS, SAMPLES)), np.zeros((2, OUTPUTS, SAMPLES))
    residual[1], slopes[:, 1] = noise - z @ design, -design
    problem = Line([Part(np.arange(SAMPLES) // BLOCK)], np.array([0.0, 1e4, 0.0]), SAMPLES // BLOCK)
    return problem, MapFit(
        free=(),
        z=z,
        cost=0.0,
        squares=np.zeros((OUTPUTS, problem.blocks)),
        residuals=(residual,),
        normal=normal,
        sensitivity=(slopes,),
        iterations=1,
    )


def test_they_cover_the_truth_whether_the_noise_is_white_or_correlated() -> None:
    """Fails when correlation within blocks is ignored: errors are then several times too small; random, fixed seed.

    Few groups cover a little less than 95 %.
    """
    rng = np.random.default_rng(7)
    for length in (1, 60):
        kernel = np.ones(length) / length
        inside, naive = 0, 0
        for _ in range(DRAWS):
            noise = np.convolve(rng.standard_normal(SAMPLES + length - 1), kernel, mode="valid")
            problem, fit = fitted(noise)
            own = robust_errors(problem, fit)
            white = np.sqrt(np.diag(np.linalg.inv(fit.normal)) * 1e4 * np.var(fit.residuals[0][1]))
            inside += int((np.abs(fit.z) < 2.0 * own).sum())
            naive += int((np.abs(fit.z) < 2.0 * white).sum())
        assert inside / (2 * DRAWS) > 0.88
        assert length == 1 or naive / (2 * DRAWS) < 0.6


def test_without_slopes_there_are_none() -> None:
    """Fails when a fit whose arrays were dropped gets errors, or an empty one stops the report."""
    problem, fit = fitted(np.zeros(SAMPLES))
    bare = MapFit(
        free=(), z=fit.z, cost=0.0, squares=fit.squares, residuals=(), normal=fit.normal, sensitivity=(), iterations=1
    )
    assert robust_errors(problem, bare).tolist() == [0.0, 0.0]
    empty = MapFit(
        free=(),
        z=np.zeros(0),
        cost=0.0,
        squares=fit.squares,
        residuals=fit.residuals,
        normal=np.zeros((0, 0)),
        sensitivity=fit.sensitivity,
        iterations=1,
    )
    assert robust_errors(problem, empty).size == 0
