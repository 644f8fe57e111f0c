"""Random shapes of laws: monotone splines, spectra, densities. Each is a function or weights of about unit size."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.interpolate import PchipInterpolator

from validation.referees.plant import FRICTION_SPEED
from validation.trial.arrays import Array

Rng = np.random.Generator
Shape = Callable[[Array], Array]


def rising(rng: Rng, low: float, high: float, knots: int = 5, *, bend: float = 1.0) -> Shape:
    """A monotone spline (k,) -> (k,) from 0 to 1 between two states; its increments vary by the factor exp(bend).

    low, high: the states [SI].  bend: standard deviation of the logarithm of an increment [-].
    """
    x = np.linspace(low, high, knots)
    steps = np.exp(bend * rng.standard_normal(knots - 1))
    y = np.concatenate([[0.0], np.cumsum(steps) / steps.sum()])
    spline = PchipInterpolator(x, y, extrapolate=False)

    def law(at: Array) -> Array:
        return np.asarray(spline(np.clip(at, low, high)))

    return law


def power_law(power: float, high: float) -> Shape:
    """|x / high|^power with the sign of x, (k,) -> (k,).  power [-], high: the state with the value 1 [SI]."""
    return lambda at: np.sign(at) * np.abs(at / high) ** power


def falling_friction(rng: Rng, peak: float, speed: float, power: float, rise: float) -> Shape:
    """Stribeck curve (k,) -> (k,) over the share v / (v + FRICTION_SPEED): a peak, a valley, a rise.

    peak, rise: heights over 1 at rest and per 10 rad/s [-].  speed: of the fall [rad/s].  power: of the fall [-].
    """

    def law(share: Array) -> Array:
        v = FRICTION_SPEED * share / np.maximum(1.0 - share, 1e-6)
        return 1.0 + peak * np.exp(-((v / speed) ** power)) + rise * np.minimum(v, 20.0) / 10.0

    return law


def iso_flow(ratio: Array, critical: float, power: float = 0.5) -> Array:
    """Flow function (k,) of ISO 6358-1 over the ratio (k,) of absolute pressures: 1 where choked.

    critical: ratio below which the flow is choked [-].  power: subsonic index [-].
    """
    x = np.clip((ratio - critical) / (1.0 - critical), 0.0, 1.0)
    return np.maximum(1.0 - x * x, 0.0) ** power


def spectrum(rng: Rng, least_s: float, most_s: float, modes: int) -> tuple[Array, Array]:
    """Weights (modes,) of sum 1 and retardation times (modes,) [s], equally spaced in their logarithm on average."""
    ends = np.linspace(math.log(least_s), math.log(most_s), modes + 1)
    times = np.exp(rng.uniform(ends[:-1], ends[1:]))
    weights = rng.dirichlet(np.full(modes, 1.5))
    return weights, times


def density(rng: Rng, largest: float, plays: int, kind: str) -> tuple[Array, Array]:
    """Weights (plays,) of sum 1 and radii (plays,) up to `largest` [SI] of a density: even, falling or a hump."""
    radii = largest * (np.arange(plays) + rng.uniform(0.3, 0.7)) / plays
    x = radii / largest
    weights = {
        "even": np.ones(plays),
        "falling": np.exp(-rng.uniform(2.0, 4.0) * x),
        "hump": np.exp(-((x - rng.uniform(0.3, 0.7)) ** 2) / 0.05),
    }[kind]
    return weights / weights.sum(), radii


def harmonics(rng: Rng, orders: tuple[int, ...], decay: float) -> Shape:
    """A Fourier series (k,) -> (k,) over the angle, random phases; amplitudes fall with the power `decay` [-]."""
    phases, sizes = rng.uniform(0.0, 2.0 * math.pi, len(orders)), np.array([n**-decay for n in orders])

    def law(angle: Array) -> Array:
        total = sum(s * np.sin(n * angle + f) for s, n, f in zip(sizes, orders, phases, strict=True))
        return np.asarray(total)

    return law
