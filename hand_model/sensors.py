"""The sensors in front of the plant, forward (quantity to voltage ratio to counts) and back.

Ratiometric sensors give a share of their supply U_0; the ADC measures volts against its own reference, so the
share is counts * reference / full scale / U_0. Arrays run over sensors in their last axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
        theta = angle_rad - self.zero_rad
        field = self.field_t * (np.sin(theta) + self.third_harmonic * np.sin(3.0 * theta))
        return 0.5 * (1.0 + field / (2.0 * self.field_max_t))


@dataclass(frozen=True, slots=True)
class AngleLine:
    """Two-point Hall calibration: the line through the ratios at 0 and 90 degrees, (joints,) each."""

    ratio_at_0_deg: Array
    ratio_at_90_deg: Array

    def angle_rad(self, ratio: Array) -> Array:
        """Joint angle [rad] from U_out / U_0."""
        return (ratio - self.ratio_at_0_deg) / (self.ratio_at_90_deg - self.ratio_at_0_deg) * (np.pi / 2.0)

    def ratio(self, angle_rad: Array) -> Array:
        """The inverse of angle_rad."""
        share = angle_rad / (np.pi / 2.0)
        return self.ratio_at_0_deg + share * (self.ratio_at_90_deg - self.ratio_at_0_deg)


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
        closed = force_n >= self.threshold_n
        resistance = 10.0 ** (self.c0 - self.c1 * np.log10(np.where(closed, force_n, 1.0)))
        return np.where(closed, self.divider_ohm / (resistance + self.divider_ohm), 0.0)


@dataclass(frozen=True, slots=True)
class ForcePolynomial:
    """FSR calibration: log10 F = sum k_i (log10 R_S)^i, third order.

    coefficients: (sites, 4), k_0 first.  divider_ohm: (sites,).  ratio_min: (sites,) U_D/U_0 below which the
    film is open and the force is 0.
    """

    coefficients: Array
    divider_ohm: Array
    ratio_min: Array

    def force_n(self, ratio: Array) -> Array:
        """Normal force [N] from U_D / U_0; 0 where the film is open."""
        closed = ratio > self.ratio_min
        inside = np.clip(np.where(closed, ratio, 0.5), 1e-6, 1.0 - 1e-6)
        x = np.log10(self.divider_ohm * (1.0 - inside) / inside)
        k = self.coefficients
        log_force = k[:, 0] + x * (k[:, 1] + x * (k[:, 2] + x * k[:, 3]))
        return np.where(closed, 10.0**log_force, 0.0)


@dataclass(frozen=True, slots=True)
class Adc:
    """The converter: resolution [bit] and reference voltage [V], unipolar from 0 V."""

    bits: int
    reference_v: float

    @property
    def full_scale(self) -> int:
        """Largest count."""
        return (1 << self.bits) - 1

    def counts(self, voltage_v: Array) -> NDArray[np.uint16]:
        """Quantise voltages [V]; what lies outside 0 ... reference sits at the rail."""
        codes = np.rint(voltage_v / self.reference_v * self.full_scale)
        return np.minimum(np.maximum(codes, 0.0), self.full_scale).astype(np.uint16)

    def voltage_v(self, counts: NDArray[np.uint16]) -> Array:
        """Volts from counts."""
        return counts.astype(np.float64) * (self.reference_v / self.full_scale)
