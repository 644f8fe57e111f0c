"""Physics that a description has beyond the plain plant, in feed-forward, torque limit, contact and set-points."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_control.controller import Controller, Times
from hand_control.declared import OUT, G, S, Settings, U
from hand_control.found import MOST, MOST_PA, FoundLaw, law_of
from hand_control.law import Law
from hand_control.shaping import Shaper
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_model.statics import pressure_for_torque
from hand_sim.plant import PHI, HandPlant, P

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
SETTINGS = Settings.of(HAND, {})
DT_S = 0.005
EFFECTS = {
    "friction": {"coulomb_friction.torque_nm": 0.005},
    "weight": {"gravity.sine_nm": 0.02, "gravity.cosine_nm": 0.01},
    "leak": {"leak.rate_per_s": 6.0},
    "dead band": {"valve_deadband.width_pa": 1e4},
    "liquid": {"hydraulic.share": 1.0},
    "coupling": {"joint_coupling.stiffness_nm_per_rad": 0.02, "joint_coupling.ratio": 0.3},
    "hysteresis": {"hysteresis.torque_nm": 0.01},
    "valve hysteresis": {"valve_hysteresis.width_pa": 1e4},
}


def described(effect: dict[str, float]) -> Hand:
    """The hand with an effect at every joint; values in the units of hand.yaml."""
    parameters = HAND.parameters.copy()
    for key, value in effect.items():
        parameters[ROW[key]] = value * JOINT_PARAMETERS[ROW[key]].scale
    return replace(HAND, parameters=parameters)


def tracking_deg(real: Hand, model: Hand) -> float:
    """RMS error [deg] of sines of all joints, one after the other in phase, with sensor noise (seed 1)."""
    rng = np.random.default_rng(1)
    law, plant = law_of(model, SETTINGS), HandPlant(real, DT_S)
    shaper = Shaper(11, law.inputs, (HAND.limits.low_rad, HAND.limits.high_rad))
    shaper.latch(plant.state[PHI])
    law.inputs[U.limit] = HAND.limits.max_torque_nm
    errors = []
    for k in range(800):
        phase = np.pi * k * DT_S + np.arange(11)
        shaper.step(np.radians(40.0 + 20.0 * np.sin(phase)), np.radians(20.0 * np.pi * np.cos(phase)), SETTINGS, DT_S)
        law.inputs[U.position] = plant.state[PHI] + 5e-4 * rng.standard_normal(11)
        law.inputs[U.pressure] = plant.state[P] + 150.0 * rng.standard_normal(11)
        if k > 200:
            errors.append(plant.state[PHI] - shaper.r)
        law.tick(law.inputs, DT_S)
        plant.advance(law.set_points()[None].copy())
    return float(np.degrees(np.sqrt(np.mean(np.square(errors)))))


@pytest.mark.parametrize("name", EFFECTS)
def test_a_described_effect_is_compensated(name: str) -> None:
    """Fails when an effect of the description no longer reduces the error of a moving joint by a quarter."""
    real = described(EFFECTS[name])
    assert tracking_deg(real, real) < 0.75 * tracking_deg(real, HAND)


def test_the_plain_hand_has_the_plain_law() -> None:
    """Fails when a description without effects costs time, or one with a load alone does not use it."""
    assert type(law_of(HAND, SETTINGS)) is Law
    assert type(law_of(described({"constant_load.torque_nm": 0.02}), SETTINGS)) is FoundLaw


def inputs(angle: float, pressure: float, limit: float) -> Array:
    """A joint at rest, far below its reference [rad, Pa, N m]; all joints alike."""
    return np.repeat(np.array([[1.5, 0.0, 0.0, limit, angle, pressure]]).T, 11, axis=1)


def test_the_torque_limit_is_that_at_an_object() -> None:
    """Fails when the weight that the actuator carries is taken from the torque at the object, or added to it."""
    hand = described({"gravity.sine_nm": 0.02, "constant_load.torque_nm": 0.01})
    law = law_of(hand, Settings.of(hand, {"creep_compensation": False, "deadband_pa": 0.0, "adaptation": False}))
    for _ in range(200):
        out = law.tick(inputs(0.8, 1e5, 0.05), DT_S)
    statics = [hand.row(f"statics.{key}") for key in ("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad")]
    carried = 0.05 + 0.01 + 0.02 * np.sin(0.8)
    assert out[OUT.pressure] == pytest.approx(pressure_for_torque(carried, 0.8, 0.0, *statics, 0.0), rel=1e-3)
    assert law.state[S.load] == pytest.approx(-(0.01 + 0.02 * np.sin(0.8)), abs=1e-6)


def test_a_described_weight_is_no_contact() -> None:
    """Fails when the balance of contact detection leaves a torque that the description explains."""
    hand = described({"constant_load.torque_nm": 0.03})
    known, plant = law_of(hand, SETTINGS), HandPlant(hand, DT_S)
    for _ in range(400):
        known.inputs[:] = inputs(0.0, 0.0, 0.6)
        known.inputs[U.reference] = 0.6
        known.inputs[U.position], known.inputs[U.pressure] = plant.state[PHI], plant.state[P]
        out = known.tick(known.inputs, DT_S)
        plant.advance(known.set_points()[None].copy())
    assert np.abs(out[OUT.contact_torque]).max() < 2e-3
    assert not out[OUT.contact].any()


def test_friction_over_the_travel_is_that_at_the_angle() -> None:
    """Fails when the feed-forward overcomes the friction of another angle than the one where the joint is."""
    effect = {"coulomb_friction.torque_nm": 0.01, "coulomb_friction.travel_slope": 0.8}
    drags = []
    for angle in (0.0, 0.9):
        law = law_of(described(effect), SETTINGS)
        for k in range(100):
            given = inputs(angle + 0.5 * DT_S * k, 1e5, 0.6)
            law.tick(given, DT_S)
        drags.append(law.state[S.drag].copy())
        speed = law.state[S.speed]
        assert np.all(speed > 0.05)  # sliding: friction has its full size
    at = [0.0 + 0.5 * DT_S * 99, 0.9 + 0.5 * DT_S * 99]
    sizes = [0.01 * (1.0 + 0.4 * angle / 1.5) ** 2 for angle in at]
    assert drags[0] == pytest.approx(-sizes[0], rel=0.02)
    assert drags[1] == pytest.approx(-sizes[1], rel=0.02)


def test_set_points_are_bounded_and_zero_stays_zero() -> None:
    """Fails when a described valve lets a vented joint be pressed, or asks for any pressure that a number gives."""
    hand = described({"leak.rate_per_s": 50.0, "valve_deadband.width_pa": 2e5, "valve_hysteresis.width_pa": 1e5})
    law = law_of(hand, SETTINGS)
    assert isinstance(law, FoundLaw)
    law.tick(inputs(0.5, 2e4, 0.6), DT_S)
    law.gains[G.p_max, 3] = 2e5
    for wanted in (0.0, 1.0, 1e5, 5e5):
        law.out[OUT.pressure] = wanted
        sent = law.set_points()
        assert (sent >= 0.0).all() and (sent <= min((1.0 + MOST) * wanted + MOST_PA, 6e5) + 1e-6).all()
        assert wanted > 0.0 or not sent.any()
        assert sent[3] <= 2e5


def test_a_broken_measurement_keeps_the_last_command() -> None:
    """Fails when a measurement that is not a number reaches the memory of the effects or the command."""
    law = law_of(described({**EFFECTS["friction"], **EFFECTS["hysteresis"]}), SETTINGS)
    for _ in range(50):
        before = law.tick(inputs(0.5, 8e4, 0.6), DT_S)[OUT.pressure].copy()
    broken = inputs(0.5, 8e4, 0.6)
    broken[U.position, 3] = np.nan
    law.tick(broken, DT_S)
    assert law.out[OUT.pressure, 3] == before[3]
    assert np.isfinite(law.tick(inputs(0.5, 8e4, 0.6), DT_S)).all() and np.isfinite(law.state).all()


def test_the_controller_sends_what_the_described_valve_needs() -> None:
    """Fails when the controller sends the wanted pressure to a leaking actuator, or takes the leak for a fault."""
    hand = described(EFFECTS["leak"])
    controller, plant = Controller(hand, Settings.of(hand, {})), HandPlant(hand, DT_S)
    controller.enable(True)
    for k in range(1, 800):
        times = Times(k * 5_000_000, k * 5_000_000, k * 5_000_000)
        state = plant.state
        tick = controller.frame(times, state[PHI].copy(), np.zeros(11), np.maximum(state[P], 0.0))
        assert tick is not None
        if k > 1:
            controller.command(times, hand.joints, [0.7] * 11, [])
        plant.advance(tick.pressure_command[None].copy())
    assert controller.safety.phase.value == "controlling"
    assert np.degrees(np.abs(plant.state[PHI] - 0.7)).max() < 1.0
    assert tick is not None and (tick.pressure_command > 1.2 * plant.state[P]).all()
    assert not any("does not follow" in health.message for health in controller.health(800 * 5_000_000))
