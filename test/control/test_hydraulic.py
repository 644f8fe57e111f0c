"""The same control law on a hand that is filled with a liquid."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_control.declared import OUT, Settings
from hand_control.law import Law
from hand_control.shaping import Shaper
from hand_control.tuning import gains
from hand_driver.board import Counts
from hand_model.description import load_hand
from hand_model.kernel.rows import ROW
from hand_sim.plant import PHI, HandPlant, P
from validation.faults.sensor_loop import Loop, Plant

CONFIG = Path(__file__).resolve().parents[2] / "config" / "hand.yaml"
RATE_HZ = 200.0


def test_steps_settle_on_a_hydraulic_hand() -> None:
    """Fails when the controller cannot hold a joint whose motion displaces an incompressible fluid."""
    hand = load_hand(CONFIG)
    parameters = hand.parameters.copy()
    parameters[ROW["hydraulic.share"]] = 1.0
    plant = HandPlant(replace(hand, parameters=parameters), 1.0 / RATE_HZ)
    settings = Settings.of(hand, {})
    law = Law(gains(hand, settings))
    shaper = Shaper(11)
    shaper.latch(plant.state[PHI])
    for target_deg in (30.0, 80.0, 30.0):
        target, still = np.full(11, np.radians(target_deg)), np.zeros(11)
        late = []
        for tick in range(600):
            shaper.step(target, still, settings, 1.0 / RATE_HZ)
            state = plant.state
            limit = hand.limits.max_torque_nm
            inputs = np.array([shaper.r, shaper.v, shaper.a, limit, state[PHI], state[P]])
            out = law.tick(inputs, 1.0 / RATE_HZ)
            plant.advance(out[OUT.pressure][None].copy())
            if tick > 500:
                late.append(np.abs(state[PHI] - target).max())
        assert np.degrees(max(late)) < 1.0, target_deg


def test_torque_is_held_on_a_hydraulic_hand() -> None:
    """Fails when a hand filled with a liquid does not hold the wanted torque against an obstacle, at any angle."""
    hand = load_hand(CONFIG)
    parameters = hand.parameters.copy()
    parameters[ROW["hydraulic.share"]] = 1.0
    parameters[ROW["contact.angle_deg"]] = np.radians(np.linspace(20.0, 70.0, 11))
    parameters[ROW["contact.stiffness_nm_per_rad"]] = 10.0
    parameters[ROW["contact.damping_nm_s_per_rad"]] = 0.05  # a spring alone would let the joint bounce for ever
    plant = HandPlant(replace(hand, parameters=parameters), 1.0 / RATE_HZ)
    law = Law(gains(hand, Settings.of(hand, {"control_mode": "torque"})))
    still, wanted = np.zeros(11), np.full(11, 0.12)
    for _ in range(1000):
        state = plant.state
        out = law.tick(np.array([still, still, still, wanted, state[PHI], state[P]]), 1.0 / RATE_HZ)
        plant.advance(out[OUT.pressure][None].copy())
    np.testing.assert_allclose(out[OUT.torque], wanted, rtol=0.02)


@pytest.mark.parametrize(
    ("liquid", "angle", "frames", "driven"),
    [(True, False, 4, True), (True, False, 20, False), (True, True, 1, False), (False, False, 1, False)],
)
def test_a_shove_may_pull_a_liquid_below_the_range_of_its_sensor(
    liquid: bool, angle: bool, frames: int, driven: bool
) -> None:
    """Fails when suction for 20 ms vents a hydraulic hand, or when a dead sensor or a missing angle does not."""
    hand = load_hand(CONFIG)
    sensors = hand.sensors
    channel = int((sensors.angle_channel if angle else sensors.pressure_channel)[4])
    loop = Loop(hand, Plant(liquid=liquid), seed=5)
    begin = loop.number + 110

    def railed(number: int, counts: Counts, supply_v: float) -> tuple[Counts, float]:
        if begin <= number < begin + frames:
            counts = counts.copy()
            counts[channel] = 0
        return counts, supply_v

    loop.fault = railed
    loop.controller.enable(True)
    loop.step()
    loop.command(np.full(len(hand.joints), 0.5))
    for _ in range(99):
        assert loop.step()
    for _ in range(100):
        controlled = loop.step()
    assert controlled == driven
    if not driven:
        assert "not a number" in loop.controller.safety.fault
