"""Calibration of a Hall angle sensor from a rig: a line through two ends, a sine, or a sine with harmonics.

The three models, from a reference angle phi and the sensor's voltage U:

    line        phi = a + b U, through the samples nearest to 0 and 90 degrees (the paper's two-point interpolation)
    sine        U = m + s sin(phi - phi_0), Eq. 1 through Eq. 3
    harmonic    U = m + sum of sines and cosines of phi and 2 phi, 3 phi: misalignment and a shaped magnet

The model with the lowest cross-validation error is chosen, the simpler one where two errors are nearly equal.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from hand_model.arrays import Array

FOLDS = 5
MARGIN = 1.1
MARGIN_DEG = 0.03
"""A richer model is chosen where its cross-validation error is lower by more than this factor and this difference,
which is about the resolution of the sensor."""
MODELS = ("line", "sine", "harmonic")


@dataclass(frozen=True, slots=True, kw_only=True)
class AngleCalibration:
    """A calibrated sensor.

    model: one of MODELS.  numbers: its coefficients (see the module).  rms_deg, largest_deg: errors over all samples.
    validation_deg: cross-validation error (RMS) by model.  low_v, high_v: voltages of the calibration.
    volts_at_0_deg, volts_at_90_deg: of the two-point line [V], which a description holds, whichever model is chosen.
    """

    model: str
    numbers: tuple[float, ...]
    rms_deg: float
    largest_deg: float
    validation_deg: dict[str, float]
    low_v: float
    high_v: float
    volts_at_0_deg: float
    volts_at_90_deg: float

    def angle_deg(self, voltage_v: Array) -> Array:
        """Angles [deg] of voltages (n,); NaN outside the voltages of the calibration."""
        inside = (voltage_v >= self.low_v) & (voltage_v <= self.high_v)
        return np.where(inside, _INVERSE[self.model](np.array(self.numbers), voltage_v), np.nan)


def calibrate_angle(angle_deg: Array, voltage_v: Array) -> AngleCalibration:
    """Fit all models and choose one. angle_deg, voltage_v: (n,), from a rig.

    Raises ValueError, one line, for too few samples, a joint that did not move, or angles outside a turn.
    """
    _check(angle_deg, voltage_v)
    validation = {model: _validation_deg(model, angle_deg, voltage_v) for model in MODELS}
    chosen = MODELS[0]
    for model in MODELS[1:]:
        if validation[model] * MARGIN + MARGIN_DEG < validation[chosen]:
            chosen = model
    numbers = _FIT[chosen](angle_deg, voltage_v)
    start_deg, slope = _fit_line(angle_deg, voltage_v)
    error = _INVERSE[chosen](numbers, voltage_v) - angle_deg
    ends = [float((end - start_deg) / slope) if slope else math.nan for end in (0.0, 90.0)]
    return AngleCalibration(
        model=chosen,
        numbers=tuple(float(x) for x in numbers),
        rms_deg=float(np.sqrt(np.mean(error**2))),
        largest_deg=float(np.abs(error).max()),
        validation_deg=validation,
        low_v=float(voltage_v.min()),
        high_v=float(voltage_v.max()),
        volts_at_0_deg=ends[0],
        volts_at_90_deg=ends[1],
    )


def _check(angle_deg: Array, voltage_v: Array) -> None:
    if len(angle_deg) < 12:
        raise ValueError(f"{len(angle_deg)} samples; 12 or more are needed")
    if np.ptp(voltage_v) < 1e-3:
        raise ValueError(f"voltage_v is constant at {voltage_v[0]:g} V; the joint must be moved")
    if np.ptp(angle_deg) < 5.0:
        span = np.ptp(angle_deg)
        hint = "; are these radians?" if np.ptp(angle_deg) > 0.3 and np.abs(angle_deg).max() < 2 * np.pi else ""
        raise ValueError(f"angle_deg spans {span:.3g} degrees; 5 or more are needed{hint}")
    if np.abs(angle_deg).max() > 360.0:
        raise ValueError(f"angle_deg reaches {np.abs(angle_deg).max():g}; the allowed range is -360 to 360")


def _validation_deg(model: str, angle_deg: Array, voltage_v: Array) -> float:
    """Cross-validation error [deg, RMS]: FOLDS interleaved folds of the sorted angles, each left out of one fit."""
    order = np.argsort(angle_deg, kind="stable")
    fold = np.empty(len(order), dtype=int)
    fold[order] = np.arange(len(order)) % FOLDS
    squares = []
    for k in range(FOLDS):
        train, test = fold != k, fold == k
        numbers = _FIT[model](angle_deg[train], voltage_v[train])
        squares.append((_INVERSE[model](numbers, voltage_v[test]) - angle_deg[test]) ** 2)
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def _fit_line(angle_deg: Array, voltage_v: Array) -> Array:
    """A line through the mean of the samples nearest to each of the two ends."""
    low, high = max(0.0, angle_deg.min()), min(90.0, angle_deg.max())
    near = [np.argsort(np.abs(angle_deg - end))[: max(1, len(angle_deg) // 50)] for end in (low, high)]
    (a0, v0), (a1, v1) = [(angle_deg[n].mean(), voltage_v[n].mean()) for n in near]
    slope = (a1 - a0) / (v1 - v0) if v1 != v0 else 0.0
    return np.array([a0 - slope * v0, slope])


def _line(numbers: Array, voltage_v: Array) -> Array:
    angle: Array = numbers[0] + numbers[1] * voltage_v
    return angle


def _harmonics(angle_deg: Array, count: int) -> Array:
    phi = np.radians(angle_deg)
    columns = [np.ones_like(phi)]
    for k in range(1, count + 1):
        columns += [np.sin(k * phi), np.cos(k * phi)]
    return np.array(columns).T


def _fit_harmonics(count: int) -> Callable[[Array, Array], Array]:
    def fit(angle_deg: Array, voltage_v: Array) -> Array:
        table = _harmonics(angle_deg, count)
        # A small ridge term: over a part of the turn the harmonics are nearly collinear.
        ridge = 1e-9 * len(table) * np.eye(table.shape[1])
        numbers = np.asarray(np.linalg.solve(table.T @ table + ridge, table.T @ voltage_v), dtype=np.float64)
        spread = float(np.std(voltage_v - table @ numbers))
        robust = least_squares(lambda x: table @ x - voltage_v, numbers, loss="soft_l1", f_scale=max(3 * spread, 1e-9))
        return np.asarray(robust.x)

    return fit


def _inverse_harmonics(count: int) -> Callable[[Array, Array], Array]:
    def inverse(numbers: Array, voltage_v: Array) -> Array:
        grid = np.linspace(-45.0, 135.0, 3601)
        curve = _harmonics(grid, count) @ numbers
        middle = int(np.argmin(np.abs(grid - 45.0)))
        rising = 1.0 if curve[middle + 1] > curve[middle - 1] else -1.0
        slope = rising * np.diff(curve)
        below, above = np.flatnonzero(slope[:middle] <= 0), np.flatnonzero(slope[middle:] <= 0)
        first = int(below[-1]) + 1 if len(below) else 0
        last = middle + int(above[0]) if len(above) else len(grid) - 1
        part = slice(first, last + 1)
        angle: Array = np.interp(rising * voltage_v, rising * curve[part], grid[part])
        return angle

    return inverse


_FIT: dict[str, Callable[[Array, Array], Array]] = {
    "line": _fit_line,
    "sine": _fit_harmonics(1),
    "harmonic": _fit_harmonics(3),
}
_INVERSE: dict[str, Callable[[Array, Array], Array]] = {
    "line": _line,
    "sine": _inverse_harmonics(1),
    "harmonic": _inverse_harmonics(3),
}
