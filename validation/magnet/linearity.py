"""How straight an angle sensor's characteristic is: Eq. 2, and what the two-point line makes of it."""

from __future__ import annotations

import numpy as np

from hand_model.arrays import Array

AMPLITUDE_V = 1.35
"""Output amplitude of an ideal sine that gives Table 1's ring exactly; Eq. 2 as a mean square has a scale."""


def nonlinearity_percent(voltage_v: Array) -> float:
    """Eq. 2 of Martin et al. 2004 over equally spaced samples (n,) [V], in percent.

    The mean square of the deviation from the least-squares line, over the span of the first to the last sample.
    Raises ValueError for fewer than three samples or no span.
    """
    if len(voltage_v) < 3 or voltage_v[-1] == voltage_v[0]:
        raise ValueError("nonlinearity: three or more samples with a span between the ends are needed")
    at = np.arange(len(voltage_v))
    line = np.polyval(np.polyfit(at, voltage_v, 1), at)
    return float(100.0 / abs(voltage_v[-1] - voltage_v[0]) * np.mean((voltage_v - line) ** 2))


def output_v(field_t: Array, peak_t: float, amplitude_v: float = AMPLITUDE_V) -> Array:
    """Sensor output (n,) [V] about mid supply for a field (n,) [T] whose peak over a turn gives the amplitude; Eq. 3,
    scaled.
    """
    output: Array = amplitude_v * field_t / peak_t
    return output


def sampled(angle_rad: Array, field_t: Array, low_deg: float, high_deg: float) -> tuple[Array, Array]:
    """Magnet angles every degree [deg] and the field there [T], (m,) each; field_t (n,) is given on 0 ... pi and odd
    about 0.
    """
    degrees = np.arange(low_deg, high_deg + 0.5)
    radians = np.radians(degrees)
    return degrees, np.sign(radians) * np.interp(np.abs(radians), angle_rad, field_t)


def joint_nonlinearity(angle_rad: Array, field_t: Array) -> tuple[float, float]:
    """Eq. 2 over joint angles 0 ... 90 and -10 ... 100 degrees; the field (n,) [T] passes zero at 45 (Eq. 1)."""
    peak = float(np.abs(field_t).max())
    ranges = ((-45.0, 45.0), (-55.0, 55.0))
    low, high = (nonlinearity_percent(output_v(sampled(angle_rad, field_t, *ends)[1], peak)) for ends in ranges)
    return low, high


def position_error_deg(angle_rad: Array, field_t: Array, half_range_deg: float = 90.0) -> tuple[Array, Array]:
    """Angles [deg] and error [deg], (m,) each, of the two-point line through the ends of a symmetric range of the
    magnet angle, from a field (n,) [T].
    """
    degrees, field = sampled(angle_rad, field_t, -half_range_deg, half_range_deg)
    return degrees, degrees[-1] * field / field[-1] - degrees
