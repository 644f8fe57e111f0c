"""A data-driven correction of a residual that no effect explains.

It is fitted by sparse regression on polynomials of angle, pressure and speed with the sign of the motion. It describes
and does not explain; the report says so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array
from hand_model.effects.effect import SPEED
from hand_model.quantities import Wording


@dataclass(frozen=True, slots=True)
class Correction:
    """residual [unit] = sum of coefficient times term; validation_share: of its mean square that it removes [-]."""

    unit: str
    terms: tuple[tuple[str, float], ...]
    validation_share: float

    @property
    def text(self) -> str:
        """The formula."""
        return " ".join(f"{value:+.3g}" + ("" if name == "1" else f" {name}") for name, value in self.terms) or "0"


def sparse_correction(problem: JointProblem, fit: MapFit, stage: int, wording: Wording) -> Correction:
    """Fit the residual of a signal on training blocks, in its shown unit, and evaluate it on validation blocks."""
    factor, unit = wording.signal_units[stage]
    libraries, targets, held = [], [], []
    for segment, residual in zip(problem.segments, fit.residuals, strict=True):
        use = segment.use[stage]
        states = segment.angle_rad[use], segment.pressure_pa[use], segment.exogenous[use, SPEED]
        libraries.append(correction_terms(*states, wording))
        targets.append(factor * residual[stage][use])
        held.append(problem.held_out[segment.block[use]])
    table = np.concatenate([np.column_stack(list(library.values())) for library in libraries])
    target, validation = np.concatenate(targets), np.concatenate(held)
    scale = np.maximum(np.abs(table).max(axis=0), 1e-12)
    rms = float(np.sqrt(np.mean(target**2))) or 1.0
    train = ~validation
    weights = thresholded_least_squares((table / scale)[train], (target / rms)[train]) * rms / scale
    left = target[validation] - table[validation] @ weights
    share = 1.0 - float(np.mean(left**2)) / max(float(np.mean(target[validation] ** 2)), 1e-300)
    terms = tuple((name, float(w)) for name, w in zip(libraries[0], weights, strict=True) if w != 0.0)
    return Correction(unit, terms, max(share, 0.0))


def thresholded_least_squares(table: Array, target: Array, threshold: float | None = None) -> Array:
    """Coefficients (n,) of the columns of a table (m, n) for a target (m,); those below a threshold are zero.

    Ridge regression and removal of small coefficients in turn, until none is small; then ordinary least squares on the
    columns that are left. Sequentially thresholded least squares: Brunton, Proctor and Kutz, PNAS 113(15), 2016.
    threshold: [unit of target over that of table]; None: SETTINGS.correction_threshold.
    """
    threshold = SETTINGS.correction_threshold if threshold is None else threshold
    kept = np.ones(table.shape[1], dtype=bool)
    for _ in range(SETTINGS.correction_iterations):
        ridge = np.sqrt(SETTINGS.correction_ridge) * np.eye(kept.sum())
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


def correction_terms(angle_rad: Array, pressure_pa: Array, speed_rad_s: Array, wording: Wording) -> dict[str, Array]:
    """Candidate terms (T,) of a correction by name, in the units of `wording.symbol_units`."""
    direction = np.tanh(speed_rad_s / SETTINGS.standing_rad_s)
    x, p, v = wording.symbols
    (per_angle, _), (per_pressure, _) = wording.symbol_units
    angle, pressure, speed = per_angle * angle_rad, per_pressure * pressure_pa, per_angle * speed_rad_s
    return {
        "1": np.ones_like(angle),
        x: angle,
        p: pressure,
        v: speed,
        f"{x}^2": angle**2,
        f"{x} {p}": angle * pressure,
        f"{p}^2": pressure**2,
        f"{x}^3": angle**3,
        f"sign({v})": direction,
        f"{p} sign({v})": pressure * direction,
        f"{v} |{v}|": speed * np.abs(speed),
    }
