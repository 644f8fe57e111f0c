"""Other models for the recordings of a machine: six fixed friction models and a sparse regression.

The friction models are fitted by least squares on the training blocks of `hand diagnose` and compared on its validation
blocks; the best one counts (as BAM compares its models; Duclusaud et al. 2025). The sparse regression fits the
discrepancy of the nominal model (SINDy; Brunton, Proctor, Kutz 2016). Where a rig imposes the motion, all models
predict the force; otherwise they are simulated and predict the position.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numba import njit
from scipy.optimize import least_squares
from scipy.signal import savgol_filter

from validation.trial.arrays import Array, Flags

Recordings = Mapping[str, dict[str, Array]]
Errors = dict[str, dict[str, float]]
BLOCK_S, HELD_OUT_EVERY = 1.25, 3
BAR_PA = 1e5
STEPS, STANDSTILL = 8, 0.02
"""Integration steps per sample, and the speed [rad/s] around which friction changes its sign."""
STARTS = (0.002, 0.006, 0.02, 0.06)
"""Start values of each friction, relative to the weight: a swing out of phase has local minima."""
FRICTIONS = {
    "viscous": (1,),
    "Coulomb": (0,),
    "Coulomb, viscous": (0, 1),
    "Coulomb, viscous, Stribeck": (0, 1, 2),
    "Coulomb, viscous, load": (0, 1, 3),
    "Coulomb, viscous, Stribeck, load, quadratic": (0, 1, 2, 3, 4),
}
"""Terms of each model by their index: Coulomb, viscous, Stribeck, load, quadratic."""


def imposed_baselines(description: Mapping[str, Any], recordings: Recordings) -> Errors:
    """RMSE of the force on training and validation data, of six friction models and of a sparse regression.

    description: the machine file.  recordings: columns time [s], position, force, input of each recording.
    """
    parts = [_features(description, columns) for columns in recordings.values()]
    discrepancy, v, p, x, train = (np.concatenate([part[k] for part in parts]) for k in range(5))
    keep = train > 0.5
    speed = float(np.std(v))
    sign, constant = np.tanh(v / (0.02 * speed)), np.ones(len(v))
    stribeck = sign * np.exp(-((v / (0.1 * speed)) ** 2))
    gravity = [np.sin(x), np.cos(x)] if description["motion"] == "rotary" else []
    terms = ([sign], [v], [stribeck], [sign * p], [stribeck * p, v * np.abs(v)])
    errors = {}
    for name, chosen in FRICTIONS.items():
        a = np.column_stack([constant, *gravity, *(column for k in chosen for column in terms[k])])
        left = discrepancy - a @ np.linalg.lstsq(a[keep], discrepancy[keep], rcond=None)[0]
        errors[name] = _errors(left, keep)
    states = np.column_stack([x, v, p, sign])
    errors["SINDy discrepancy"] = _errors(discrepancy - _sparse(states, discrepancy, keep)(states), keep)
    return errors


def _errors(left: Array, keep: Flags) -> dict[str, float]:
    train, validation = (float(np.sqrt(np.mean(left[part] ** 2))) for part in (keep, ~keep))
    return {"train": train, "validation": validation}


def _features(description: Mapping[str, Any], columns: dict[str, Array]) -> tuple[Array, Array, Array, Array, Array]:
    """Discrepancy of the force from the nominal model, speed, input [bar], position, and 1 for training samples."""
    t, x = columns["time"], columns["position"]
    period = float(np.median(np.diff(t)))
    span = max(2 * round(0.06 / period) + 1, 5)
    v, a = (savgol_filter(x, span, 3, deriv=k, delta=period) for k in (1, 2))
    given = columns.get("input", np.zeros(len(t)))
    modelled = description.get("gain", 0.0) * given - description["inertia"] * a
    modelled = modelled - description["stiffness"] * x - description.get("weight", 0.0) * np.sin(x)
    return columns.get("force", 0.0) - modelled, v, given / BAR_PA, x, _train(t).astype(float)


def _train(t: Array) -> Flags:
    """Training samples as `hand diagnose` chooses them: one of every three blocks is drawn for validation."""
    block = ((t - t[0]) / BLOCK_S).astype(int)
    drawn = np.random.default_rng(HELD_OUT_EVERY).integers(HELD_OUT_EVERY, size=block[-1] // HELD_OUT_EVERY + 1)
    return np.asarray(block % HELD_OUT_EVERY != drawn[block // HELD_OUT_EVERY])


def _sparse(states: Array, discrepancy: Array, keep: Flags) -> Callable[[Array], Array]:
    """The discrepancy as a function of the states (samples, k): a sparse regression on their cubic monomials."""
    import pysindy  # noqa: PLC0415 - slow to load, and only here

    scale = np.maximum(states[keep].std(axis=0), 1e-12)
    library = pysindy.PolynomialLibrary(degree=3)
    features = np.asarray(library.fit_transform(states / scale), dtype=np.float64)
    optimizer = pysindy.STLSQ(threshold=0.05 * float(np.std(discrepancy[keep])), alpha=1e-3, normalize_columns=False)
    optimizer.fit(features[keep], discrepancy[keep][:, None])
    weights = np.asarray(optimizer.coef_, dtype=np.float64)[0]

    def predict(x: Array) -> Array:
        return np.asarray(np.asarray(library.transform(x / scale), dtype=np.float64) @ weights)

    return predict


def moved_baselines(description: Mapping[str, Any], recordings: Recordings) -> Errors:
    """RMSE of the angle [deg] on training and validation data of a hanging axis without input; models are simulated.

    Besides friction, every model has weight, attitude and the first speed of each recording as free parameters; the
    inertia is the nominal one.
    """
    inertia, weight = float(description["inertia"]), float(description["weight"])
    parts = [_features(description, columns) for columns in recordings.values()]
    discrepancy, v, _, x, train = (np.concatenate([part[k] for part in parts]) for k in range(5))
    keep, lengths = train > 0.5, np.array([len(part[0]) for part in parts])
    starts = np.concatenate([[0], np.cumsum(lengths)[:-1]])
    period = float(np.median(np.diff(next(iter(recordings.values()))["time"])))
    errors, simpler = {}, np.full(5, 1e-4 * weight)
    for name, chosen in FRICTIONS.items():

        def left(z: Array, chosen: tuple[int, ...] = chosen) -> Array:
            friction = np.zeros(5)
            friction[list(chosen)] = np.abs(z[: len(chosen)])
            share, attitude, *speeds = z[len(chosen) :]
            swung: Array = _swing(
                x, starts, lengths, np.array(speeds), weight * share, attitude, friction, inertia, period
            )
            return np.asarray(swung - x)

        fits = []
        for guess in [*(np.full(5, share * weight) for share in STARTS), simpler]:
            begin = np.concatenate([guess[list(chosen)], [1.0, 0.0], v[starts]])
            size = np.maximum(np.abs(begin), 0.01)
            fits.append(least_squares(lambda z, left=left: left(z)[keep], begin, x_scale=size))
        best = min(fits, key=lambda fit: fit.cost).x
        simpler[list(chosen)] = np.abs(best[: len(chosen)])
        errors[name] = _errors(np.degrees(left(best)), keep)
    correct = _sparse(np.column_stack([x, v, np.tanh(v / STANDSTILL)]), discrepancy, keep)
    simulated = np.concatenate(
        [
            _corrected(x[at], v[at], count, correct, constants=(inertia, weight, period))
            for at, count in zip(starts, lengths, strict=True)
        ]
    )
    errors["SINDy discrepancy"] = _errors(np.degrees(simulated - x), keep)
    return errors


@njit(cache=True)
def _swing(x, starts, lengths, speeds, weight, attitude, friction, inertia, period):  # type: ignore[no-untyped-def]
    """Angles (samples,) [rad] of a pendulum from the first sample of each recording; semi-implicit Euler method."""
    out, h = np.empty(len(x)), period / STEPS
    coulomb, viscous, stribeck, load, quadratic = friction
    for k in range(len(starts)):
        angle, speed = x[starts[k]], speeds[k]
        for n in range(lengths[k]):
            out[starts[k] + n] = angle
            for _ in range(STEPS):
                pull = weight * np.sin(angle + attitude)
                dry = coulomb + load * abs(pull) + stribeck * np.exp(-((speed / 0.2) ** 2))
                wet = viscous + quadratic * abs(speed)
                speed += h * (-pull - wet * speed - dry * np.tanh(speed / STANDSTILL)) / inertia
                angle += h * speed
    return out


def _corrected(
    angle: float,
    speed: float,
    samples: int,
    correct: Callable[[Array], Array],
    *,
    constants: tuple[float, float, float],
) -> Array:
    """Angles (samples,) [rad] of the nominal model with the torque of a regression added."""
    inertia, weight, h = constants
    out = np.empty(samples)
    for n in range(samples):
        out[n] = angle
        state = np.clip([angle, speed, np.tanh(speed / STANDSTILL)], -20.0, 20.0)  # a polynomial can grow without bound
        speed += h * float(-weight * np.sin(angle) + correct(state[None])[0]) / inertia
        angle = float(np.clip(angle + h * speed, -20.0, 20.0))
    return out
