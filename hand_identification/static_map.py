"""Static identification on a rig: the torque map of Eq. 6 and the volume map, by multilinear regression (Sec. 3.1).

Standard errors count correlated samples as fewer: the residual's integrated autocorrelation time divides their number.
A warning names each coefficient that the data do not excite.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hand_model.arrays import Array

TERMS = ("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad")
WEAK = 0.05
"""A term counts as not excited where the other regressors explain its own one except for this share of its norm."""
MIN_PRESSURE_SPAN_PA = 2e4
MIN_ANGLE_SPAN_DEG = 10.0
PRESSURE_UNITS = ((0.2, 10.0, "bar"), (20.0, 1000.0, "kPa"))
ANGLE_UNITS = ((0.17, 2.0, "radians"),)
"""Spans [Pa, degrees] that a rig has whose numbers are in another unit: least, most, unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticMap:
    """Eq. 6: values and standard errors of a0 ... a3 (4,), r2, RMS residual [N m], warnings, covariance (4, 4).

    samples, independent: number of samples, and of independent samples given their correlation.
    """

    values: Array
    errors: Array
    covariance: Array
    r2: float
    rms_nm: float
    samples: int
    independent: float
    warnings: tuple[str, ...]

    def torque_nm(self, pressure_pa: Array, angle_rad: Array) -> Array:
        """Torque (n,) [N m] at pressures (n,) [Pa gauge] and angles (n,), Eq. 6."""
        torque: Array = regressors(pressure_pa, angle_rad) @ self.values
        return torque

    def torque_std_nm(
        self, pressure_pa: Array, angle_rad: Array, *, pressure_std_pa: float, angle_std_rad: float
    ) -> Array:
        """Standard deviation (n,) [N m] of torque_nm by first-order propagation (Martin et al. 2004, Sec. 2.3, 3.1).

        The errors of the map's coefficients and those of both sensors, whose standard deviations are given, add up.
        """
        table = regressors(pressure_pa, angle_rad)
        from_map = np.einsum("ni,ij,nj->n", table, self.covariance, table)
        by_pressure = (self.values[2] + self.values[3] * angle_rad) * pressure_std_pa
        by_angle = (self.values[1] + self.values[3] * pressure_pa) * angle_std_rad
        return np.asarray(np.sqrt(from_map + by_pressure**2 + by_angle**2))


@dataclass(frozen=True, slots=True)
class VolumeMap:
    """V_a = V0 + cV p + v_phi phi + v_2 phi^2: values and errors (4,), and ratios that are 1 by virtual work.

    By virtual work dV/dphi = dM/dp = a2 + a3 phi: v_phi should be a2 and v_2 half of a3.
    """

    values: Array
    errors: Array
    r2: float
    displacement_over_a2: float
    curvature_over_half_a3: float


def regressors(pressure_pa: Array, angle_rad: Array) -> Array:
    """Columns of Eq. 6 (n, 4): 1, phi, p, p phi, SI."""
    return np.array([np.ones_like(angle_rad), angle_rad, pressure_pa, pressure_pa * angle_rad]).T


def identify_statics(pressure_pa: Array, angle_rad: Array, torque_nm: Array) -> StaticMap:
    """Regress Eq. 6 from samples (n,) of a rig. Raises ValueError, one line, where they do not determine a map."""
    _check(pressure_pa, angle_rad, torque_nm)
    table = regressors(pressure_pa, angle_rad)
    values, covariance, residual, independent = _regress(table, torque_nm)
    r2 = 1.0 - float(np.var(residual) / np.var(torque_nm))
    rms = float(np.sqrt(np.mean(residual**2)))
    errors = np.sqrt(np.diag(covariance))
    warnings = _warnings(table, values, errors, pressure_pa, angle_rad)
    return StaticMap(
        values=values,
        errors=errors,
        covariance=covariance,
        r2=r2,
        rms_nm=rms,
        samples=len(torque_nm),
        independent=independent,
        warnings=warnings,
    )


def identify_volume(pressure_pa: Array, angle_rad: Array, volume_m3: Array, torque_map: StaticMap) -> VolumeMap:
    """Regress V_a(phi, p) from samples (n,) and compare it with the torque map by virtual work."""
    table = np.array([np.ones_like(angle_rad), pressure_pa, angle_rad, angle_rad**2]).T
    values, covariance, residual, _ = _regress(table, volume_m3)
    r2 = 1.0 - float(np.var(residual) / np.var(volume_m3))
    ratios = values[2] / torque_map.values[2], 2.0 * values[3] / torque_map.values[3]
    return VolumeMap(values, np.sqrt(np.diag(covariance)), r2, float(ratios[0]), float(ratios[1]))


def residual_map(
    static: StaticMap, pressure_pa: Array, angle_rad: Array, torque_nm: Array, bins: int = 8
) -> tuple[Array, Array, Array]:
    """Mean residual [N m] over cells of (p, phi): edges of p (bins+1,), of phi (bins+1,), means (bins, bins) or NaN."""
    residual = torque_nm - static.torque_nm(pressure_pa, angle_rad)
    total, p_edges, phi_edges = np.histogram2d(pressure_pa, angle_rad, bins=bins, weights=residual)
    count = np.histogram2d(pressure_pa, angle_rad, bins=[p_edges, phi_edges])[0]
    return p_edges, phi_edges, np.where(count > 0, total / np.maximum(count, 1), np.nan)


def correlation_time(residual: Array) -> float:
    """Integrated autocorrelation time of a residual (n,) [samples], at least 1, up to the first crossing of 0.05."""
    centred = residual - residual.mean()
    power = np.abs(np.fft.rfft(centred, 2 * len(centred))) ** 2
    correlation = np.fft.irfft(power)[: len(centred)]
    if correlation[0] <= 0.0:
        return 1.0
    correlation = correlation / correlation[0]
    negative = np.flatnonzero(correlation <= 0.05)
    end = int(negative[0]) if len(negative) else len(correlation)
    return float(max(1.0, 1.0 + 2.0 * correlation[1:end].sum()))


def _regress(table: Array, target: Array) -> tuple[Array, Array, Array, float]:
    """Least squares with scaled columns: values, covariance, residual, independent samples."""
    scale = np.abs(table).max(axis=0)
    scaled = table / np.where(scale > 0, scale, 1.0)
    values, _, _, _ = np.linalg.lstsq(scaled, target, rcond=None)
    residual = target - scaled @ values
    independent = max(len(target) / correlation_time(residual), table.shape[1] + 1.0)
    variance = float(residual @ residual) / len(target) * independent / (independent - table.shape[1])
    covariance = variance * np.linalg.pinv(scaled.T @ scaled) * len(target) / independent
    return values / scale, covariance / np.outer(scale, scale), residual, independent


def _warnings(table: Array, values: Array, errors: Array, pressure_pa: Array, angle_rad: Array) -> tuple[str, ...]:
    """A line for each term with a nearly collinear regressor, or with an error above half its value."""
    scaled = table / np.linalg.norm(table, axis=0)
    lines = []
    for k, term in enumerate(TERMS):
        others = np.delete(scaled, k, axis=1)
        own = scaled[:, k] - others @ np.linalg.lstsq(others, scaled[:, k], rcond=None)[0]
        if np.linalg.norm(own) < WEAK:
            lines.append(
                f"{term}: hardly excited; vary angle and pressure independently (pressure spans"
                f" {np.ptp(pressure_pa):.3g} Pa, angle {np.degrees(np.ptp(angle_rad)):.3g} degrees)"
            )
        elif errors[k] > 0.5 * abs(values[k]):
            lines.append(f"{term}: its standard error is {errors[k] / max(abs(values[k]), 1e-300):.0%} of its value")
    return tuple(lines)


def _check(pressure_pa: Array, angle_rad: Array, torque_nm: Array) -> None:
    if len(torque_nm) < 12:
        raise ValueError(f"{len(torque_nm)} samples; 12 or more are needed")
    if np.ptp(pressure_pa) < MIN_PRESSURE_SPAN_PA:
        raise ValueError(
            f"the pressure spans {np.ptp(pressure_pa):.3g} Pa; {MIN_PRESSURE_SPAN_PA:g} or more are needed to"
            f" determine a2 and a3{_unit_question(np.ptp(pressure_pa), PRESSURE_UNITS)}"
        )
    if np.degrees(np.ptp(angle_rad)) < MIN_ANGLE_SPAN_DEG:
        raise ValueError(
            f"the angle spans {np.degrees(np.ptp(angle_rad)):.3g} degrees; {MIN_ANGLE_SPAN_DEG:g} or more are needed"
            f" to determine a1 and a3{_unit_question(np.degrees(np.ptp(angle_rad)), ANGLE_UNITS)}"
        )
    if np.ptp(torque_nm) == 0.0:
        raise ValueError(f"the torque is constant at {torque_nm[0]:g} N m; is the torque sensor connected?")


def _unit_question(span: float, units: tuple[tuple[float, float, str], ...]) -> str:
    """The question whether a span is in another unit; empty where it is in the range of none."""
    for least, most, unit in units:
        if least <= span <= most:
            return f"; are the numbers in {unit}?"
    return ""
