"""The same control law on a hand that is filled with a liquid."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from hand_control.declared import OUT, Settings
from hand_control.law import Law
from hand_control.shaping import Shaper
from hand_control.tuning import gains
from hand_model.description import load_hand
from hand_model.kernel.rows import ROW
from hand_sim.plant import PHI, HandPlant, P

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
