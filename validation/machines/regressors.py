"""Rivals without physics: sparse regression, a Gaussian process, and a neural network on past values (NARX).

All have a fixed seed. The first two are laws of the lacking force (see parts.Law); the network predicts the signal.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from validation.machines.parts import Law, Part
from validation.trial.arrays import Array

THRESHOLDS = (0.02, 0.05, 0.1, 0.2)
"""Thresholds of the sparse regression, in standard deviations of the lacking force."""
GAUSSIAN_SAMPLES, NETWORK_SAMPLES = 400, 6000
LAGS, SPACINGS, NEURONS = 8, (1, 4, 12), 24


def stacked(parts: Sequence[Part]) -> tuple[Array, Array]:
    """States (n, 4) and lacking force (n,) of all known samples."""
    states = np.concatenate([part.states[part.known] for part in parts])
    return states, np.concatenate([part.lacking[part.known] for part in parts])


def sparse_laws(parts: Sequence[Part]) -> list[Law]:
    """Sparse regressions on cubic monomials of the states, one for each threshold (SINDy; Brunton et al. 2016)."""
    import pysindy  # noqa: PLC0415 - slow to load, and only here

    states, lacking = stacked(parts)
    scale = np.where(states.std(axis=0) > 0.0, states.std(axis=0), 1.0)
    size = float(np.std(lacking)) or 1.0
    library = pysindy.PolynomialLibrary(degree=3)
    features = np.asarray(library.fit_transform(states / scale), dtype=np.float64)
    powers = np.asarray(library.powers_, dtype=np.float64)
    return [_sparse(pysindy, features, lacking / size, powers, scale, size, threshold) for threshold in THRESHOLDS]


def _sparse(pysindy, features, lacking, powers, scale, size, threshold) -> Law:  # type: ignore[no-untyped-def]
    optimizer = pysindy.STLSQ(threshold=threshold, alpha=1e-3, normalize_columns=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a threshold above every coefficient is the law that nothing lacks
        optimizer.fit(features, lacking[:, None])
    weights = np.asarray(optimizer.coef_, dtype=np.float64)[0]
    kept = weights != 0.0
    powers, weights = powers[kept], size * weights[kept]

    def law(states: Array) -> Array:
        scaled = np.clip(states / scale, -20.0, 20.0)  # a polynomial can grow without bound
        return np.asarray((scaled[:, None, :] ** powers[None]).prod(axis=2) @ weights)

    return law


def gaussian_law(parts: Sequence[Part], seed: int = 0) -> Law:
    """Mean of a Gaussian process with a length scale a state, fitted to a drawn part of the samples."""
    from sklearn.gaussian_process import GaussianProcessRegressor  # noqa: PLC0415 - slow to load, and only here
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel  # noqa: PLC0415 - as above

    states, lacking = stacked(parts)
    drawn = np.random.default_rng(seed).choice(len(lacking), min(GAUSSIAN_SAMPLES, len(lacking)), replace=False)
    used = states.std(axis=0) > 0.0
    centre, scale = states.mean(axis=0), np.where(used, states.std(axis=0), 1.0)
    middle, size = float(lacking.mean()), float(lacking.std()) or 1.0
    kernel = ConstantKernel() * RBF(np.ones(4), (0.05, 1e3)) + WhiteKernel(0.1, (1e-6, 2.0))
    process = GaussianProcessRegressor(kernel, random_state=seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a length scale at its bound is a state without influence
        process.fit((states[drawn] - centre) / scale, (lacking[drawn] - middle) / size)
    height, lengths = process.kernel_.k1.k1.constant_value, process.kernel_.k1.k2.length_scale
    points, weights = process.X_train_ / lengths, size * height * process.alpha_

    def law(asked: Array) -> Array:
        scaled = (asked - centre) / scale / lengths
        distances = (scaled**2).sum(axis=1)[:, None] - 2.0 * scaled @ points.T + (points**2).sum(axis=1)
        return np.asarray(np.exp(-0.5 * distances) @ weights + middle)

    return law


@dataclass(frozen=True, slots=True)
class Network:
    """A network on past values. spacing: samples between them.  feedback: number of own past predictions used."""

    spacing: int
    feedback: int
    imposed: bool
    forward: Callable[[Array], Array]

    def predict(self, part: Part) -> Array:
        """The signal (n,) [its unit]; the first values are measured, the later ones follow from its own predictions."""
        rows = slice(None, None, self.spacing)
        given, measured = _inputs(part, self.imposed)[rows], part.target[rows]
        out = measured.copy()
        if not self.feedback:
            out[LAGS:] = self.forward(_windows(given))
        else:
            past = _windows(given)
            for n in range(LAGS, len(out)):
                own = out[n - self.feedback : n][::-1]
                change = float(
                    self.forward(np.concatenate([past[n - LAGS], own - own[0] * self.is_change, own[:1]])[None])[0]
                )
                out[n] = np.clip(change + out[n - 1] * self.is_change, -1e9, 1e9)
        times = np.arange(len(part.target), dtype=np.float64)
        return np.asarray(np.interp(times, times[rows], out))

    @property
    def is_change(self) -> float:
        """1 [-] where the network predicts the change of the signal: a position is almost its last value."""
        return 0.0 if self.imposed else 1.0


def _inputs(part: Part, imposed: bool) -> Array:
    """What drives the network (n, k): input, and of an imposed motion position, speed and acceleration."""
    if not imposed:
        return part.states[:, 2:3]
    return np.column_stack([part.states[:, :3], part.acceleration])


def _windows(given: Array) -> Array:
    """The last LAGS + 1 values of each input (n - LAGS, k (LAGS + 1)), the present one included."""
    return np.concatenate([given[LAGS - lag : len(given) - lag] for lag in range(LAGS + 1)], axis=1)


def networks(parts: Sequence[Part], imposed: bool, seed: int = 0) -> list[Network]:
    """One network for each spacing; of an imposed motion, with and without its own past predictions."""
    choices = [(spacing, feedback) for spacing in SPACINGS for feedback in ((0, 2) if imposed else (LAGS,))]
    return [_network(parts, imposed, spacing, feedback, seed) for spacing, feedback in choices]


def _network(parts: Sequence[Part], imposed: bool, spacing: int, feedback: int, seed: int) -> Network:
    from sklearn.neural_network import MLPRegressor  # noqa: PLC0415 - slow to load, and only here

    rows, wanted = [], []
    for part in parts:
        at = slice(None, None, spacing)
        given, measured, known = _inputs(part, imposed)[at], part.target[at], part.known[at]
        if len(measured) <= LAGS:
            continue
        past, target = _windows(given), measured[LAGS:]
        if feedback:
            own = np.column_stack([measured[LAGS - k : len(measured) - k] for k in range(1, feedback + 1)])
            shift = 0.0 if imposed else own[:, :1]
            past, target = np.column_stack([past, own - shift, own[:, :1]]), target - (0.0 if imposed else own[:, 0])
        rows.append(past[known[LAGS:]])
        wanted.append(target[known[LAGS:]])
    x, y = np.concatenate(rows), np.concatenate(wanted)
    drawn = np.random.default_rng(seed).permutation(len(y))[:NETWORK_SAMPLES]
    centre, scale = x.mean(axis=0), np.where(x.std(axis=0) > 0.0, x.std(axis=0), 1.0)
    middle, size = float(y.mean()), float(y.std()) or 1.0
    fit = MLPRegressor(hidden_layer_sizes=(NEURONS,), alpha=1e-3, activation="tanh", max_iter=400, random_state=seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the number of epochs is limited on purpose
        fit.fit((x[drawn] - centre) / scale, (y[drawn] - middle) / size)
    first, second = fit.coefs_
    bias, end = fit.intercepts_

    def forward(asked: Array) -> Array:
        hidden = np.tanh((asked - centre) / scale @ first + bias)
        return np.asarray((hidden @ second + end)[:, 0] * size + middle)

    return Network(spacing, feedback, imposed, forward)
