"""The magnet's contour as Eq. 4, optimised for linearity: the paper's genetic algorithm, CMA-ES and least squares.

Genes stand every 10 degrees over the half circle and are mirrored, evaluated every degree. The goal is the largest
and the RMS position error of the straight line through the ends of -90 ... 90 degrees of the magnet angle.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

import cma
import numpy as np
from deap import base, creator, tools
from scipy.optimize import least_squares

from hand_model.arrays import Array
from validation.magnet.field import Magnet, radial_field
from validation.magnet.linearity import position_error_deg

Progress = Callable[[int], None]

GENES = 19
SMALLEST_M, LARGEST_M = 2.2e-3, 2.9e-3
"""The paper's contours lie between these."""
HIGHEST_GENE_M = 0.45e-3
WIDTH_RAD = np.radians(10.0)
"""Sigma of Eq. 4; the paper does not print it. The spacing of the genes makes their sum smooth."""
INNER_M, SENSOR_M = 1.0e-3, 3.4e-3
"""Hole and sensor circle; the paper does not print them."""
POPULATION = 25
TOURNAMENT = 3
COARSE_ELEMENTS = 36
DIFFERENCE, PULL_DEG = 1e-3, 1e-3
"""Least squares: relative step of the derivatives, and weight [deg] that keeps genes without influence small."""
METHODS = ("ga", "cmaes", "lsq")


def contour_m(genes_m: Array) -> Array:
    """Eq. 4: radius (181,) [m] every degree from 0 to 180 for genes (GENES,) [m]; mirrored about both ends, kept in
    range.
    """
    angle = np.radians(np.arange(181.0))
    places = np.radians(np.linspace(0.0, 180.0, GENES))
    radius = np.full(181, SMALLEST_M)
    for k, place in enumerate(places):
        images = (place, -place, 2.0 * np.pi - place) if 0 < k < GENES - 1 else (place,)
        for image in images:
            radius += genes_m[k] * np.exp(-((image - angle) ** 2) / (2.0 * WIDTH_RAD**2))
    clipped: Array = np.clip(radius, SMALLEST_M, LARGEST_M)
    return clipped


def magnet_of(genes_m: Array) -> Magnet:
    """The ring with the contour of Eq. 4 for genes (GENES,) [m]."""
    return Magnet(contour_m(genes_m), INNER_M, SENSOR_M)


def cost_deg(genes_m: Array, elements: int = COARSE_ELEMENTS) -> float:
    """RMS plus a third of the largest position error [deg] over -90 ... 90 degrees of the magnet angle, for genes
    (GENES,) [m].
    """
    return _cost_deg(position_error_deg(*radial_field(magnet_of(genes_m), elements))[1])


def _cost_deg(error_deg: Array) -> float:
    return float(np.sqrt(np.mean(error_deg**2)) + np.abs(error_deg).max() / 3.0)


@dataclass(frozen=True, slots=True)
class Optimum:
    """What a method found: genes [m], its cost [deg], and the best cost after each evaluation (evaluations,)."""

    method: str
    genes_m: Array
    cost_deg: float
    history_deg: Array


def optimise(method: str, budget: int, seed: int, progress: Progress) -> Optimum:
    """Search with `budget` field evaluations at most. progress is called with 1 after each.

    The genetic algorithm and CMA-ES use all of them; least squares stops where it has converged.

    ValueError for an unknown method.
    """
    if method not in METHODS:
        raise ValueError(f"method is {method!r}; it must be one of {', '.join(METHODS)}")
    seen: list[tuple[float, Array]] = []

    def errors_deg(genes: Array) -> Array:
        allowed = np.clip(genes, 0.0, HIGHEST_GENE_M)
        error = position_error_deg(*radial_field(magnet_of(allowed), COARSE_ELEMENTS))[1]
        seen.append((_cost_deg(error), allowed))
        progress(1)
        return error

    if method == "lsq":
        _least_squares(errors_deg, budget, seed)
    else:
        search = _genetic if method == "ga" else _cma
        search(lambda genes: _cost_deg(errors_deg(genes)), budget, seed)
    costs = np.array([cost for cost, _ in seen])
    best = int(np.argmin(costs))
    return Optimum(method, seen[best][1], float(costs[best]), np.minimum.accumulate(costs))


def _genetic(evaluate: Callable[[Array], float], budget: int, seed: int) -> None:
    """Steady state: two parents chosen by tournament give a child, which replaces the worst contour if it is better."""
    rng = np.random.default_rng(seed)
    random.seed(seed)  # DEAP draws from Python's generator
    if not hasattr(creator, "LeastError"):
        creator.create("LeastError", base.Fitness, weights=(-1.0,))
        creator.create("Contour", list, fitness=creator.LeastError)
    population = [creator.Contour(rng.uniform(0.0, 0.5 * HIGHEST_GENE_M, GENES)) for _ in range(POPULATION)]
    population = population[: max(2, budget)]
    for contour in population:
        contour.fitness.values = (evaluate(np.array(contour)),)
    for _ in range(budget - len(population)):
        parents = tools.selTournament(population, 2, tournsize=min(TOURNAMENT, len(population)))
        child = creator.Contour(parents[0])
        tools.cxBlend(child, creator.Contour(parents[1]), alpha=0.3)
        tools.mutGaussian(child, mu=0.0, sigma=0.08 * HIGHEST_GENE_M, indpb=0.3)
        child[:] = np.clip(child, 0.0, HIGHEST_GENE_M)
        child.fitness.values = (evaluate(np.array(child)),)
        worst = tools.selWorst(population, 1)[0]
        if child.fitness > worst.fitness:
            population[population.index(worst)] = child


def _cma(evaluate: Callable[[Array], float], budget: int, seed: int) -> None:
    options = {
        "bounds": [0.0, 1.0],
        "maxfevals": budget,
        "seed": seed + 1,
        "verbose": -9,
        "verb_disp": 0,
        "verb_log": 0,
    }
    search = cma.CMAEvolutionStrategy(np.full(GENES, 0.2), 0.15, options)
    done = 0
    while done < budget:
        points = search.ask()[: budget - done]
        costs = [evaluate(HIGHEST_GENE_M * point) for point in points]
        done += len(points)
        if len(points) < search.popsize:
            break
        search.tell(points, costs)


def _least_squares(errors_deg: Callable[[Array], Array], budget: int, seed: int) -> None:
    """Trust region with bounds (Branch, Coleman, Li 1999) on the position errors themselves, from a random contour.

    An iteration costs one field and one for each gene's derivative.
    """
    start = np.random.default_rng(seed).uniform(0.05, 0.5, GENES)

    def residual(shares: Array) -> Array:
        return np.concatenate([errors_deg(HIGHEST_GENE_M * shares)[1:-1:3], PULL_DEG * shares])

    least_squares(
        residual, start, bounds=(0.0, 1.0), x_scale=0.2, diff_step=DIFFERENCE, max_nfev=max(1, budget // (GENES + 1))
    )
