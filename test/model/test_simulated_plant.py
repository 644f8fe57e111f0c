"""Plant and sensors behind the board: counts, noise, seeds, forces."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hand_driver.board import Status
from hand_model.description import Hand
from hand_model.kernel.layout import OMEGA, PHI, P
from hand_model.kernel.rows import ROW, STATES
from hand_sim.channels import contact_force_n
from hand_sim.plant import SimulatedPlant, resting_state


def quiet(hand: Hand) -> Hand:
    sensors = hand.sensors
    silent = {
        name: replace(getattr(sensors, name), noise_v=np.zeros_like(getattr(sensors, name).noise_v))
        for name in ("hall", "pressure", "force")
    }
    return replace(hand, sensors=replace(sensors, **silent))


def touched(hand: Hand, angle_rad: float) -> Hand:
    """The hand with an obstacle at an angle before every joint."""
    parameters = hand.parameters.copy()
    parameters[ROW["contact.angle_deg"]] = angle_rad
    parameters[ROW["contact.stiffness_nm_per_rad"]] = 5.0
    return replace(hand, parameters=parameters)


def test_rest_is_rest(hand: Any) -> None:
    """Broken by a resting state that moves by itself."""
    plant = SimulatedPlant(hand, 200.0)
    for _ in range(200):
        plant.step(np.zeros(11))
    np.testing.assert_allclose(plant.plant.state, resting_state(hand), atol=1e-6)


def test_counts_are_the_sensors_of_the_state(hand: Any) -> None:
    """Broken by a channel that carries another sensor, or a conversion in another order."""
    silent = touched(quiet(hand), 0.6)
    plant = SimulatedPlant(silent, 200.0)
    pressures = np.linspace(1e5, 5e5, 11)
    for _ in range(200):
        counts, supply_v, status = plant.step(pressures)
    sensors, state = silent.sensors, plant.plant.state
    ratio = sensors.adc.voltage_v(counts) / supply_v
    resolution = sensors.adc.reference_v / sensors.adc.full_scale / supply_v
    assert status == Status(0)
    np.testing.assert_allclose(ratio[sensors.angle_channel], sensors.hall.ratio(state[PHI]), atol=resolution)
    np.testing.assert_allclose(ratio[sensors.pressure_channel], sensors.pressure.ratio(state[P]), atol=resolution)
    force = contact_force_n(silent, state)
    assert np.all(force[:-1] > 0.5)
    np.testing.assert_allclose(sensors.force_polynomial.force_n(ratio[sensors.force_channel]), force, rtol=1e-3)
    assert force[-1] == 0.0  # nothing presses the palm


def test_ratiometric_supply(hand: Any) -> None:
    """Broken by counts that do not follow the sensor supply in proportion."""
    plant = SimulatedPlant(quiet(hand), 200.0)
    state = resting_state(hand)
    full, low = (plant.convert(state, volts).astype(float) for volts in (5.0, 4.5))
    np.testing.assert_allclose(low, full * 0.9, atol=1.0)


def test_noise_has_the_standard_deviation_given(hand: Any) -> None:
    """Broken by noise in counts or ratio instead of volts, or on the wrong channels."""
    plant = SimulatedPlant(hand, 200.0, seed=12)
    state = resting_state(hand)
    state[P] = 2e5
    counts = np.array([plant.convert(state, 5.0) for _ in range(4000)])
    sensors = hand.sensors
    deviation = sensors.adc.voltage_v(counts).std(axis=0)
    step = sensors.adc.reference_v / sensors.adc.full_scale
    for channels, noise_v in (
        (sensors.angle_channel, sensors.hall.noise_v),
        (sensors.pressure_channel, sensors.pressure.noise_v),
    ):
        np.testing.assert_allclose(deviation[channels], np.sqrt(noise_v**2 + step**2 / 12), rtol=0.06)


def test_seed_decides_the_noise(hand: Any) -> None:
    """Broken by a random source that is not the seeded one."""
    runs = [SimulatedPlant(hand, 200.0, seed).step(np.zeros(11))[0] for seed in (1, 1, 2)]
    np.testing.assert_array_equal(runs[0], runs[1])
    assert np.any(runs[0] != runs[2])


def test_set_points_beyond_the_supply_are_flagged(hand: Any) -> None:
    """Broken by a starved supply that nobody hears of."""
    plant = SimulatedPlant(hand, 200.0)
    assert plant.step(np.full(11, 6e5))[2] == Status(0)
    assert plant.step(np.full(11, 6.1e5))[2] == Status.SUPPLY_LOW


@pytest.mark.parametrize("shape", [(), (5,), (2, 3)])
def test_contact_force_of_any_number_of_states(hand: Any, shape: tuple[int, ...]) -> None:
    """Broken by a force over another lever arm, or axes that get mixed up."""
    blocked = touched(hand, 0.5)
    state = np.zeros((*shape, STATES, 11))
    state[..., PHI, :] = 0.5 + np.radians(1.0) + 0.01
    state[..., OMEGA, :] = np.random.default_rng(0).normal(size=(*shape, 11))
    force = contact_force_n(blocked, state)
    assert force.shape == (*shape, 11)
    torque = 5.0 * (0.01 + 0.5 * np.radians(1.0))
    np.testing.assert_allclose(force[..., 0], torque / 0.03)
    np.testing.assert_allclose(force[..., 1], torque / 0.025)
    assert np.all(contact_force_n(hand, state) == 0.0)
