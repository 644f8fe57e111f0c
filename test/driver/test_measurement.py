"""Counts to SI units: calibration, rails, supply, velocity, and the zero of the pressure sensors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hand_driver.board import Frame, Status
from hand_driver.measurement import Converter, VelocityEstimator
from hand_driver.zero import PressureZero
from hand_model.description import load_hand
from hand_sim.offline import without_noise
from hand_sim.plant import CREEP, PHI, P, SimulatedPlant

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
COUNT = len(HAND.joints)
FINE = Status(0)


def frame(counts: np.ndarray, supply_v: float = 5.0, status: Status = FINE) -> Frame:
    return Frame(0, 5000, supply_v, status, counts.astype(np.uint16), 0)


def counts_of(angle_rad: float, pressure_pa: float, supply_v: float) -> np.ndarray:
    state = np.zeros((4, COUNT))
    state[PHI], state[P], state[CREEP] = angle_rad, pressure_pa, 0.0
    return SimulatedPlant(without_noise(HAND), 200.0).convert(state, supply_v)


@settings(deadline=None)
@given(st.floats(-0.17, 1.74), st.floats(0.0, 6e5), st.floats(4.2, 5.1))
def test_measures_what_the_sensors_saw_at_any_supply(angle_rad: float, pressure_pa: float, supply_v: float) -> None:
    """Fails when calibration is not the inverse of the sensors, or the supply voltage shows in the result."""
    measured = Converter(HAND, 0.0).convert(frame(counts_of(angle_rad, pressure_pa, supply_v), supply_v))
    assert np.degrees(measured.position) == pytest.approx(np.degrees(angle_rad), abs=0.52)  # two-point line
    assert measured.pressure == pytest.approx(pressure_pa, abs=20.0)


def test_a_channel_at_its_rail_is_no_value_and_is_named() -> None:
    """Fails when a broken wire reads as an angle."""
    counts = counts_of(0.5, 1e5, 5.0)
    counts[HAND.sensors.angle_channel[3]] = 65535
    counts[HAND.sensors.pressure_channel[4]] = 0
    converter = Converter(HAND, 0.0)
    measured = converter.convert(frame(counts))
    assert np.flatnonzero(np.isnan(measured.position)).tolist() == [3]
    assert np.flatnonzero(np.isnan(measured.pressure)).tolist() == [4]
    assert measured.at_rail == (f"{HAND.joints[3]} angle", f"{HAND.joints[4]} pressure")


@pytest.mark.parametrize(("supply_v", "status"), [(3.0, Status(0)), (0.0, Status(0)), (5.0, Status.ADC_FAULT)])
def test_without_supply_or_converter_nothing_is_measured(supply_v: float, status: Status) -> None:
    """Fails when sensors without their supply, or a failed conversion, give values."""
    measured = Converter(HAND, 0.0).convert(frame(counts_of(0.5, 1e5, 5.0), supply_v, status))
    assert np.isnan(measured.position).all()
    assert np.isnan(measured.pressure).all()


def test_velocity_has_the_lag_that_was_set() -> None:
    """Fails when the velocity estimate lags by more or less than its time constant."""
    for time_constant_s in (0.0, 0.05):
        estimator = VelocityEstimator(1, time_constant_s)
        for k in range(1, 11):
            estimator.update(np.array([0.0]), k * 1000)
        history = [estimator.update(np.array([k * 2e-3]), 10_000 + k * 1000)[0] for k in range(1, 200)]
        reached = int(np.argmax(np.array(history) >= 2.0 * (1.0 - np.exp(-1.0)))) + 1
        assert reached * 1e-3 == pytest.approx(max(time_constant_s, 1e-3), abs=2e-3)


def test_velocity_after_a_gap_starts_from_zero() -> None:
    """Fails when a joint that was not measured for a frame gets a velocity from nowhere."""
    estimator = VelocityEstimator(1, 0.0)
    estimator.update(np.array([0.0]), 1000)
    assert estimator.update(np.array([np.nan]), 2000)[0] == 0.0
    assert estimator.update(np.array([1.0]), 3000)[0] == 0.0


def test_pressure_zero_needs_a_vented_hand() -> None:
    """Fails when a zero is taken under pressure, too early, or from a broken sensor."""
    zero = PressureZero(HAND)
    shifted = counts_of(0.0, 700.0, 5.0)
    for _ in range(350):
        zero.frame(frame(shifted, status=Status.VENTED))
    ratio, line = zero.result()
    assert HAND.sensors.pressure.pressure_pa(ratio) == pytest.approx(700.0, abs=20.0)
    assert "largest offset" in line
    zero.frame(frame(shifted))
    with pytest.raises(ValueError, match="must be vented"):
        zero.result()
    for _ in range(350):
        zero.frame(frame(counts_of(0.0, 3e5, 5.0), status=Status.VENTED))
    with pytest.raises(ValueError, match="while vented"):
        zero.result()
