"""Calibration of a force sensing resistor against a lab scale (Martin et al. 2004, Sec. 2.2, Eq. 5).

R_S follows from the divider's voltage; log10 F is a third-order polynomial of log10 R_S, by least squares. Outside the
resistances of the samples the calibration gives NaN.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hand_model.arrays import Array

ORDER = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceCalibration:
    """log10 F = sum coefficients[k] (log10 R_S)^k.  Errors in N: RMS and largest, and relative RMS.

    Valid for resistances low_ohm ... high_ohm, which are forces high_n ... low_n.
    c0, c1: the straight line of Eq. 5 through the same samples, log10 R_S = c0 - c1 log10 F.
    """

    coefficients: tuple[float, ...]
    supply_v: float
    divider_ohm: float
    low_ohm: float
    high_ohm: float
    low_n: float
    high_n: float
    rms_n: float
    largest_n: float
    relative_rms: float
    c0: float
    c1: float

    def force_n(self, voltage_v: Array) -> Array:
        """Forces [N] of divider voltages (n,) [V]; NaN outside the valid range."""
        resistance = resistance_ohm(voltage_v, self.supply_v, self.divider_ohm)
        inside = (resistance >= self.low_ohm * (1 - 1e-9)) & (resistance <= self.high_ohm * (1 + 1e-9))
        with np.errstate(invalid="ignore", divide="ignore"):
            force = 10.0 ** np.polynomial.polynomial.polyval(np.log10(resistance), self.coefficients)
        return np.where(inside, force, np.nan)

    def sensitivity_v_per_n(self, force_n: Array) -> Array:
        """dU_D/dF [V/N] at forces (n,) inside the valid range, by differences along the calibration."""
        resistance = np.geomspace(self.low_ohm, self.high_ohm, 2000)
        voltage = self.supply_v * self.divider_ohm / (resistance + self.divider_ohm)
        force = 10.0 ** np.polynomial.polynomial.polyval(np.log10(resistance), self.coefficients)
        order = np.argsort(force)
        slope = np.gradient(voltage[order], force[order])
        return np.interp(force_n, force[order], slope, left=np.nan, right=np.nan)


def resistance_ohm(voltage_v: Array, supply_v: float, divider_ohm: float) -> Array:
    """R_S (n,) [ohm] behind divider voltages (n,), Eq. 5's U_D = U_0 R_D / (R_S + R_D); infinite at 0 V."""
    with np.errstate(divide="ignore"):
        resistance: Array = divider_ohm * (supply_v / np.asarray(voltage_v, dtype=np.float64) - 1.0)
    return resistance


def calibrate_force(force_n: Array, voltage_v: Array, supply_v: float, divider_ohm: float) -> ForceCalibration:
    """Fit the samples force_n (n,) and voltage_v (n,) of a divider with supply U_0 and resistor R_D.

    Raises ValueError, one line, for samples that cannot come from such a sensor.
    """
    _check(force_n, voltage_v, supply_v, divider_ohm)
    resistance = resistance_ohm(voltage_v, supply_v, divider_ohm)
    x, y = np.log10(resistance), np.log10(force_n)
    coefficients = np.polynomial.polynomial.polyfit(x, y, ORDER)
    fitted = 10.0 ** np.polynomial.polynomial.polyval(x, coefficients)
    grid = np.linspace(x.min(), x.max(), 400)
    if np.any(np.diff(np.polynomial.polynomial.polyval(grid, coefficients)) >= 0.0):
        raise ValueError("the fitted force does not fall with the resistance everywhere; are samples mixed up?")
    slope, intercept = np.polyfit(y, x, 1)
    error = fitted - force_n
    return ForceCalibration(
        coefficients=tuple(float(c) for c in coefficients),
        supply_v=supply_v,
        divider_ohm=divider_ohm,
        low_ohm=float(resistance.min()),
        high_ohm=float(resistance.max()),
        low_n=float(fitted.min()),
        high_n=float(fitted.max()),
        rms_n=float(np.sqrt(np.mean(error**2))),
        largest_n=float(np.abs(error).max()),
        relative_rms=float(np.sqrt(np.mean((error / force_n) ** 2))),
        c0=float(intercept),
        c1=float(-slope),
    )


def _check(force_n: Array, voltage_v: Array, supply_v: float, divider_ohm: float) -> None:
    if not (supply_v > 0.0 and divider_ohm > 0.0):
        raise ValueError(f"supply is {supply_v:g} V and divider {divider_ohm:g} ohm; both must be above 0")
    if len(force_n) < 2 * (ORDER + 1):
        raise ValueError(f"{len(force_n)} samples; {2 * (ORDER + 1)} or more are needed")
    if force_n.min() <= 0.0:
        raise ValueError(f"force_n is {force_n.min():g} somewhere; the allowed range is above 0 N (log-log fit)")
    if not (voltage_v.min() > 0.0 and voltage_v.max() < supply_v):
        low, high = voltage_v.min(), voltage_v.max()
        raise ValueError(
            f"voltage_v lies in {low:g} to {high:g}; the allowed range is 0 to {supply_v:g}, both excluded"
        )
    if len(np.unique(force_n)) < ORDER + 1:
        raise ValueError(f"force_n has {len(np.unique(force_n))} different values; {ORDER + 1} or more are needed")
    if np.corrcoef(np.log(force_n), voltage_v)[0, 1] < 0.0:
        raise ValueError("the voltage falls as the force rises; are the columns or the divider exchanged?")
