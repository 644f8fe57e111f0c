"""A data-driven correction where no effect explains a residual: sparse regression of it on the states.

Sequentially thresholded least squares (Brunton, Proctor and Kutz, PNAS 113(15), 2016) on polynomials of angle, pressure
and speed with the sign of the motion. It describes, it does not explain: the report says so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hand_identification.joint_problem import SHOWN, UNITS, JointProblem
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array
from hand_model.effects.effect import SPEED

THRESHOLD = 0.05
"""Of the residual's RMS: smaller terms are dropped."""
SLOW_RAD_S = 0.05
RIDGE, ITERATIONS = 1e-3, 10
"""Weight of the ridge penalty; upper bound on the rounds of removal."""


@dataclass(frozen=True, slots=True)
class Correction:
    """residual = sum of coefficient times term, in the shown unit; held-out share of variance that it takes away."""

    signal_unit: str
    terms: tuple[tuple[str, float], ...]
    held_out_share: float

    @property
    def text(self) -> str:
        """A formula for people; states are scaled: rad, bar, rad/s."""
        return " ".join(f"{value:+.3g} {name}" for name, value in self.terms) or "0"

    def scaled(self, unit: str, size: float, angle: float, pressure_bar: float) -> Correction:
        """In other units: what one of the signal's, of the angle's, of the pressure's is there."""
        terms = []
        for name, value in self.terms:
            turned = name.count("omega") - name.count("sign(omega)") + _power(name, "phi")
            terms.append((name, value * size / angle**turned / pressure_bar ** _power(name, "p")))
        return Correction(unit, tuple(terms), self.held_out_share)


def _power(name: str, symbol: str) -> int:
    """Of a symbol in the name of a term of the library."""
    factors = [factor.split("^") for factor in name.split()]
    return sum(int(factor[1]) if len(factor) > 1 else 1 for factor in factors if factor[0] == symbol)


def sparse_correction(problem: JointProblem, fit: MapFit, stage: int) -> Correction:
    """Fit the residual of a stage on train blocks and judge it on held-out ones."""
    rows, targets, held = [], [], []
    for segment, residual in zip(problem.segments, fit.residuals, strict=True):
        use = segment.use[stage]
        rows.append(_library(segment.angle_rad[use], 1e-5 * segment.pressure_pa[use], segment.exogenous[use, SPEED]))
        targets.append(SHOWN[stage] * residual[stage][use])
        held.append(problem.held_out[segment.block[use]])
    names = [name for name, _ in rows[0]]
    table = np.concatenate([np.column_stack([values for _, values in part]) for part in rows])
    target, out = np.concatenate(targets), np.concatenate(held)
    scale = np.maximum(np.abs(table).max(axis=0), 1e-12)
    rms = float(np.sqrt(np.mean(target**2))) or 1.0
    weights = thresholded_least_squares((table / scale)[~out], (target / rms)[~out], THRESHOLD) * rms / scale
    left = target[out] - table[out] @ weights
    share = 1.0 - float(np.mean(left**2)) / max(float(np.mean(target[out] ** 2)), 1e-300)
    terms = tuple((name, float(w)) for name, w in zip(names, weights, strict=True) if w != 0.0)
    return Correction(UNITS[stage], terms, max(share, 0.0))


def thresholded_least_squares(table: Array, target: Array, threshold: float) -> Array:
    """Coefficients (n,) of the columns of table (m, n) for target (m,); those below the threshold are zero.

    Ridge regression and removal of small coefficients in turn, until none is small; then ordinary least squares on
    the columns that are left.
    """
    kept = np.ones(table.shape[1], dtype=bool)
    for _ in range(ITERATIONS):
        ridge = np.sqrt(RIDGE) * np.eye(kept.sum())
        part = np.vstack([table[:, kept], ridge])
        found = np.linalg.lstsq(part, np.concatenate([target, np.zeros(len(ridge))]), rcond=None)[0]
        large = np.abs(found) >= threshold
        kept[kept] = large
        if large.all() or not kept.any():
            break
    coefficients = np.zeros(table.shape[1])
    if kept.any():
        coefficients[kept] = np.linalg.lstsq(table[:, kept], target, rcond=None)[0]
    return coefficients


def _library(angle: Array, pressure_bar: Array, speed: Array) -> list[tuple[str, Array]]:
    """Candidate terms."""
    direction = np.tanh(speed / SLOW_RAD_S)
    return [
        ("1", np.ones_like(angle)),
        ("phi", angle),
        ("p", pressure_bar),
        ("omega", speed),
        ("phi^2", angle**2),
        ("phi p", angle * pressure_bar),
        ("p^2", pressure_bar**2),
        ("phi^3", angle**3),
        ("sign(omega)", direction),
        ("p sign(omega)", pressure_bar * direction),
        ("omega |omega|", speed * np.abs(speed)),
    ]
