"""Sensors forward and back: Hall, pressure, FSR, ADC."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hand_model.description import load_hand
from hand_model.sensors import Adc, AngleLine, ForcePolynomial, ForceSensors, HallSensors, PressureSensors


def column(*values: float) -> Any:
    return np.array(values)


def hall(third_harmonic: float) -> HallSensors:
    return HallSensors(column(0.1), column(0.05), column(np.radians(45)), column(third_harmonic), column(0.0))


def test_hall_is_equation_1_and_3_exactly() -> None:
    """Broken by a third harmonic that acts although it is 0, or another scale than Eq. 3's."""
    degrees = np.array([-10.0, 0.0, 45.0, 90.0, 100.0])
    ratio = hall(0.0).ratio(np.radians(degrees)[:, None])[:, 0]
    field = 0.1 * np.sin(np.radians(degrees - 45.0))
    np.testing.assert_allclose(5.0 * ratio, 5.0 / 2 * (1 + field / (2 * 0.05)), rtol=1e-15)
    assert ratio[2] == 0.5


def line_error_deg(hand: Any, sensors: HallSensors) -> Any:
    """Error [deg] of the two-point line over -10 ... 100 deg of every joint."""
    degrees = np.linspace(-10, 100, 1101)[:, None]
    angles = np.repeat(np.radians(degrees), len(hand.joints), axis=1)
    ends = [sensors.ratio(np.full(len(hand.joints), np.radians(x))) for x in (0.0, 90.0)]
    return np.degrees(AngleLine(*ends).angle_rad(sensors.ratio(angles))) - degrees


def test_two_point_line_stays_within_half_a_degree(hand: Any) -> None:
    """Broken by a magnet that is not the contour magnet of Fig. 6, or a line through other points."""
    assert np.abs(line_error_deg(hand, hand.sensors.hall)).max() < 0.5
    assert np.abs(line_error_deg(hand, hall(0.0))).max() > 2.5  # a plain disc magnet is far worse
    ends = np.array([np.zeros(11), np.full(11, np.pi / 2)])
    np.testing.assert_allclose(hand.sensors.angle_line.angle_rad(hand.sensors.hall.ratio(ends)), ends, atol=1e-12)


def test_hall_signal_uses_the_published_span(hand: Any) -> None:
    """Broken by a sensor that leaves 0.5 ... 4.5 V in the joint's range, or the ADC's."""
    volts = 5.0 * hand.sensors.hall.ratio(np.radians(np.linspace(-10, 100, 111))[:, None])
    assert volts.min() > 0.4
    assert volts.max() < 4.6
    assert np.all(np.diff(volts, axis=0) > 0)


@given(st.floats(-1.0, 2.5), st.floats(0.05, 0.45), st.floats(0.55, 0.95), st.booleans())
def test_angle_line_inverse(angle: float, low: float, high: float, falling: bool) -> None:
    """Broken by an inverse of the calibration line that is not one, also with the magnet turned round."""
    line = AngleLine(column(high if falling else low), column(low if falling else high))
    assert line.angle_rad(line.ratio(column(angle)))[0] == pytest.approx(angle, abs=1e-12)


@given(st.floats(-1e5, 2e6), st.floats(0.0, 0.9), st.floats(1e4, 1e8))
def test_pressure_inverse(pressure: float, zero: float, span: float) -> None:
    """Broken by a pressure calibration that is not the inverse of the sensor."""
    sensor = PressureSensors(column(zero), 1.0 / column(span), column(0.0))
    assert sensor.pressure_pa(sensor.ratio(column(pressure)))[0] == pytest.approx(pressure, abs=1e-7 * span)


fsr = st.tuples(st.floats(4.0, 6.0), st.floats(0.3, 1.0), st.floats(1e4, 1e5), st.floats(1e-2, 0.5))


@given(fsr, st.floats(0.0, 1.0))
def test_force_polynomial_inverts_equation_5(characteristic: tuple[float, ...], share: float) -> None:
    """Broken by a default polynomial that is not Eq. 5 solved for log F, from the threshold to 100 N (Fig. 7)."""
    c0, c1, divider, threshold = characteristic
    sensor = ForceSensors(*(column(x) for x in (c0, c1, divider, threshold, 0.0)))
    force = column(threshold * (100.0 / threshold) ** share)
    ratio = sensor.ratio(force)
    polynomial = ForcePolynomial(
        np.array([[c0 / c1, -1.0 / c1, 0.0, 0.0]]), column(divider), 0.5 * sensor.ratio(column(threshold))
    )
    assert polynomial.force_n(ratio)[0] == pytest.approx(force[0], rel=1e-6)


def test_force_of_the_shipped_hand(hand: Any) -> None:
    """Broken by an FSR outside Fig. 8 (about 3 V at 15 N), an open film that presses, or a loss below the threshold."""
    force, polynomial = hand.sensors.force, hand.sensors.force_polynomial
    sites = len(hand.sensors.sites)
    assert 5.0 * force.ratio(np.full(sites, 15.0)) == pytest.approx(np.full(sites, 3.0), abs=0.2)
    assert np.all(force.ratio(np.full(sites, 0.099)) == 0.0)
    assert np.all(polynomial.force_n(np.zeros(sites)) == 0.0)
    for newton in np.geomspace(0.1, 100.0, 31):
        np.testing.assert_allclose(polynomial.force_n(force.ratio(np.full(sites, newton))), newton, rtol=1e-9)


def test_force_polynomial_is_of_third_order(variant: Any) -> None:
    """Broken by coefficients in another order, or a natural logarithm."""
    change = ("lever_arm_m: 0.025", "lever_arm_m: 0.025\n  calibration_log_polynomial: [3.1, -0.5, 0.02, -0.003]")
    polynomial = load_hand(variant(change)).sensors.force_polynomial
    ratio = np.full(11, 0.4)
    x = np.log10(2.7e4 * 0.6 / 0.4)
    np.testing.assert_allclose(polynomial.force_n(ratio), 10 ** (3.1 - 0.5 * x + 0.02 * x**2 - 0.003 * x**3))


def test_given_calibration_line_is_used(variant: Any) -> None:
    """Broken by a line in the file that the nominal one overrides."""
    change = ("noise_v: 3.0e-4", "noise_v: 0\n    calibration: {ratio_at_0_deg: 0.2, ratio_at_90_deg: 0.7}")
    line = load_hand(variant(change)).sensors.angle_line
    np.testing.assert_allclose(np.degrees(line.angle_rad(np.full(11, 0.45))), 45.0)


@given(st.integers(8, 16), st.floats(1.0, 10.0), st.floats(-1.0, 12.0))
def test_adc_quantises_to_half_a_step(bits: int, reference: float, volts: float) -> None:
    """Broken by truncation, a wrong full scale, wrap-around beyond a rail, or counts that are no uint16."""
    adc = Adc(bits, reference)
    counts = adc.counts(column(volts))
    assert counts.dtype == np.uint16
    assert 0 <= counts[0] <= adc.full_scale == 2**bits - 1
    step = reference / adc.full_scale
    inside = min(max(volts, 0.0), reference)
    assert adc.voltage_v(counts)[0] == pytest.approx(inside, abs=0.5 * step * (1 + 1e-9))
