"""Step tracking on the simulated hand: 30 to 80 degrees on every joint, counts in, set-points out."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from hand_control.controller import Controller
from hand_control.settings import Settings
from hand_driver.board import Frame
from hand_driver.measurement import Converter
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_sim.plant import SimulatedPlant
from validation.bench.result import figure

LOW_DEG, HIGH_DEG, BAND_DEG = 30.0, 80.0, 1.0
BEFORE_S, AFTER_S = 3.0, 3.0
SETTLE_GOAL_S, OVERSHOOT_GOAL_PERCENT = 1.5, 5.0
SEED = 20
VELOCITY_TIME_CONSTANT_S = 0.01


def run(quick: bool) -> list[dict[str, Any]]:
    print(f"seed {SEED}")
    hand = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
    results = []
    for rate_hz in (200,) if quick else (200, 500, 1000):
        settle_s, overshoot = figures(step_response(hand, rate_hz, SEED), rate_hz)
        for what, value, goal, unit in (
            ("settling time", settle_s, SETTLE_GOAL_S, "s"),
            ("overshoot", overshoot, OVERSHOOT_GOAL_PERCENT, "%"),
        ):
            name = f"30-80 degree step at {rate_hz} Hz, worst joint: {what}"
            results.append(figure(name, value, goal, unit))
    return results


def step_response(hand: Hand, rate_hz: float, seed: int, plant: SimulatedPlant | None = None) -> Array:
    """Measured angles (samples, joints) [degree] from the step on; every joint steps at once."""
    plant = plant or SimulatedPlant(hand, rate_hz, seed)
    controller = Controller(hand, Settings.of(hand, {}))
    controller.enable(True)
    converter = Converter(hand, VELOCITY_TIME_CONSTANT_S)
    pressure = np.zeros(hand.valve_count)
    angles = []
    for number in range(1, round((BEFORE_S + AFTER_S) * rate_hz) + 1):
        counts, supply_v, status = plant.step(pressure)
        now_ns = round(number / rate_hz * 1e9)
        measured = converter.convert(Frame(number, now_ns // 1000, supply_v, status, counts, now_ns))
        tick = controller.frame(now_ns, now_ns, now_ns, measured.position, measured.velocity, measured.pressure)
        assert tick is not None
        pressure = tick.pressure_command.copy()
        for at_s, angle_deg in ((0.05, LOW_DEG), (BEFORE_S, HIGH_DEG)):
            if number == round(at_s * rate_hz):
                target = [math.radians(angle_deg)] * len(hand.joints)
                controller.command(hand.joints, target, [], 0, now_ns, now_ns)
        angles.append(np.degrees(measured.position))
    return np.array(angles[round(BEFORE_S * rate_hz) :])


def figures(angles: Array, rate_hz: float) -> tuple[float, float]:
    """Settling time [s] into the band for good, and overshoot [% of the step], of the worst joint."""
    outside = np.abs(angles - HIGH_DEG) > BAND_DEG
    last = np.where(outside.any(axis=0), len(angles) - np.argmax(outside[::-1], axis=0), 0)
    overshoot = (angles.max(axis=0) - HIGH_DEG) / (HIGH_DEG - LOW_DEG) * 100.0
    return float(last.max()) / rate_hz, max(0.0, float(overshoot.max()))
