"""The sensors in front of the plant, forward (quantity to voltage ratio to counts) and back.

Ratiometric sensors give a share of their supply U_0; the ADC measures volts against its own reference, so the
share is counts * reference / full scale / U_0. Arrays run over sensors in their last axis. The functions state
each characteristic once; compiled kernels call them for single sensors, the classes for arrays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array
from hand_model.compile_cache import njit
from hand_model.kernel.inline import inline_exact

MONOTONE_DEG, CURVE_POINTS = (-40.0, 130.0), 1701
"""Angles over which the curve of a Hall sensor rises, around the range of a joint, and points of its inverse."""


@inline_exact
def hall_ratio(angle, field, field_max, zero, third_harmonic):  # type: ignore[no-untyped-def]
    """U_out / U_0 of a Hall sensor at a joint angle [rad]: Eq. 1, with a third harmonic, through Eq. 3."""
    theta = angle - zero
    return 0.5 * (1.0 + field * (np.sin(theta) + third_harmonic * np.sin(3.0 * theta)) / (2.0 * field_max))


@inline_exact
def line_angle(ratio, at_0_deg, at_90_deg):  # type: ignore[no-untyped-def]
    """Angle [rad] on the line through the ratios at 0 and 90 degrees (Sec. 2.1)."""
    return (ratio - at_0_deg) / (at_90_deg - at_0_deg) * (np.pi / 2.0)


@inline_exact
def fsr_ratio(force, c0, c1, divider, threshold):  # type: ignore[no-untyped-def]
    """U_D / U_0 of one FSR (Eq. 5) in its divider [ohm] at a normal force [N]; 0 below the threshold."""
    if force < threshold:
        return 0.0
    return divider / (10.0 ** (c0 - c1 * math.log10(force)) + divider)


@inline_exact
def fsr_force(ratio, k, divider, ratio_min):  # type: ignore[no-untyped-def]
    """Normal force [N] of one FSR (Eq. 5) from U_D / U_0: log10 F = sum k_i (log10 R_S)^i; 0 where open."""
    if ratio <= ratio_min:
        return 0.0
    inside = min(max(ratio, 1e-6), 1.0 - 1e-6)
    x = math.log10(divider * (1.0 - inside) / inside)
    return 10.0 ** (k[0] + x * (k[1] + x * (k[2] + x * k[3]))) + 0.0 * ratio


@inline_exact
def adc_code(volts, reference, full_scale):  # type: ignore[no-untyped-def]
    """Nearest code of an ideal ADC; what lies outside 0 ... reference [V] sits at the rail."""
    return min(max(np.rint(volts / reference * full_scale), 0.0), full_scale)


@njit(cache=True)
def _fsr_forces(ratio, k, divider, ratio_min, out):  # type: ignore[no-untyped-def]
    for n in range(ratio.shape[0]):
        for i in range(ratio.shape[1]):
            out[n, i] = fsr_force(ratio[n, i], k[i], divider[i], ratio_min[i])


@njit(cache=True)
def _adc_codes(volts, reference, full_scale, out):  # type: ignore[no-untyped-def]
    for i in range(len(volts)):
        out[i] = adc_code(volts[i], reference, full_scale)


@dataclass(frozen=True, slots=True)
class HallSensors:
    """Angle sensors, Eq. 1 and 3; every array is (joints,).

    field_t: B_0 [T].  field_max_t: B_max of Eq. 3 [T].  zero_rad: phi_0.  third_harmonic: share of a third
    harmonic in the magnet's field (a contour magnet is flatter than a sine; 0 is Eq. 1 exactly).
    noise_v: standard deviation [V].
    """

    field_t: Array
    field_max_t: Array
    zero_rad: Array
    third_harmonic: Array
    noise_v: Array

    def ratio(self, angle_rad: Array) -> Array:
        """U_out / U_0 at joint angles [rad]: Eq. 1, with the third harmonic, through Eq. 3."""
        ratio: Array = hall_ratio.py_func(angle_rad, self.field_t, self.field_max_t, self.zero_rad, self.third_harmonic)
        return ratio


@dataclass(frozen=True, slots=True)
class AngleLine:
    """Two-point Hall calibration (Sec. 2.1): the line through the ratios at 0 and 90 degrees, (joints,) each."""

    ratio_at_0_deg: Array
    ratio_at_90_deg: Array

    def angle_rad(self, ratio: Array) -> Array:
        """Joint angle [rad] from U_out / U_0."""
        angle: Array = line_angle.py_func(ratio, self.ratio_at_0_deg, self.ratio_at_90_deg)
        return angle

    def ratio(self, angle_rad: Array) -> Array:
        """The inverse of angle_rad, a ratio [-]."""
        share = angle_rad / (np.pi / 2.0)
        return self.ratio_at_0_deg + share * (self.ratio_at_90_deg - self.ratio_at_0_deg)


def without_curve(hall: HallSensors, line: AngleLine, measured_rad: Array) -> Array:
    """True angles (T, joints) [rad] at which sensors give what their lines read as measured_rad (Eq. 1, 3 inverted).

    Angles beyond MONOTONE_DEG are those of its ends.
    """
    grid = np.radians(np.linspace(*MONOTONE_DEG, CURVE_POINTS))
    curves = line.angle_rad(hall.ratio(np.repeat(grid[:, None], measured_rad.shape[1], axis=1)))
    curves = np.maximum.accumulate(curves, axis=0)
    columns = zip(measured_rad.T, curves.T, strict=True)
    return np.column_stack([np.interp(readings, curve, grid) for readings, curve in columns])


@dataclass(frozen=True, slots=True)
class PressureSensors:
    """Linear ratiometric pressure sensors at the valves, (joints,) each; inverse included.

    ratio_at_zero: share of the supply at 0 Pa gauge.  ratio_per_pa: slope [1/Pa].  noise_v: [V].
    """

    ratio_at_zero: Array
    ratio_per_pa: Array
    noise_v: Array

    def ratio(self, pressure_pa: Array) -> Array:
        """U_out / U_0 at gauge pressures [Pa]."""
        return self.ratio_at_zero + self.ratio_per_pa * pressure_pa

    def pressure_pa(self, ratio: Array) -> Array:
        """Gauge pressure [Pa] from U_out / U_0."""
        return (ratio - self.ratio_at_zero) / self.ratio_per_pa


@dataclass(frozen=True, slots=True)
class ForceSensors:
    """FSR force sensors, Eq. 5, in a buffered voltage divider; every array is (sites,).

    c0, c1: log10 R_S = c0 - c1 log10 F (ohm, N).  divider_ohm: R_D.  threshold_n: smallest force that
    closes the film at all.  noise_v: [V].
    """

    c0: Array
    c1: Array
    divider_ohm: Array
    threshold_n: Array
    noise_v: Array

    def ratio(self, force_n: Array) -> Array:
        """U_D / U_0 = R_D / (R_S + R_D) at normal forces [N]; 0 below the threshold."""
        each = np.vectorize(fsr_ratio.py_func, otypes=[np.float64])  # few numbers: compiling a loop takes 0.4 s
        return np.asarray(each(force_n, self.c0, self.c1, self.divider_ohm, self.threshold_n))


@dataclass(frozen=True, slots=True)
class ForcePolynomial:
    """FSR calibration (Sec. 2.2): log10 F = sum k_i (log10 R_S)^i, third order.

    coefficients: (sites, 4), k_0 first.  divider_ohm: (sites,).  ratio_min: (sites,) U_D/U_0 below which the
    film is open and the force is 0.
    """

    coefficients: Array
    divider_ohm: Array
    ratio_min: Array

    def force_n(self, ratio: Array) -> Array:
        """Normal force [N] from U_D / U_0; 0 where the film is open, NaN for NaN."""
        ratios, out = _by_site(ratio)
        _fsr_forces(ratios, self.coefficients, self.divider_ohm, self.ratio_min, out)
        return out.reshape(np.shape(ratio))


@dataclass(frozen=True, slots=True)
class Adc:
    """The ideal converter: resolution [bit] and reference voltage [V], unipolar from 0 V."""

    bits: int
    reference_v: float

    @property
    def full_scale(self) -> int:
        """Largest count."""
        return (1 << self.bits) - 1

    def counts(self, voltage_v: Array) -> NDArray[np.uint16]:
        """Quantise voltages (n,) [V] as counts (n,); what lies outside 0 ... reference sits at the rail."""
        out = np.empty(np.size(voltage_v), np.uint16)
        _adc_codes(np.ascontiguousarray(voltage_v, dtype=np.float64).ravel(), self.reference_v, self.full_scale, out)
        return out.reshape(np.shape(voltage_v))

    def voltage_v(self, counts: NDArray[np.uint16]) -> Array:
        """Voltages (n,) [V] from counts (n,)."""
        return counts.astype(np.float64) * (self.reference_v / self.full_scale)


def _by_site(values: Array) -> tuple[Array, Array]:
    """Values (..., sites) as (n, sites), and room for as many results."""
    rows = np.ascontiguousarray(values, dtype=np.float64).reshape(-1, np.shape(values)[-1])
    return rows, np.empty_like(rows)
