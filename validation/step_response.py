"""The response of the whole control path to a step of every joint, on the simulated hand."""

from __future__ import annotations

import math

import numpy as np

from hand_control.controller import Controller, Times
from hand_control.declared import Settings
from hand_driver.board import Frame
from hand_driver.measurement import Converter
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_sim.plant import SimulatedPlant

LOW_DEG, HIGH_DEG, BAND_DEG = 30.0, 80.0, 1.0
BEFORE_S, AFTER_S = 3.0, 3.0
VELOCITY_TIME_CONSTANT_S = 0.01


def step_response(hand: Hand, rate_hz: float, seed: int, plant: SimulatedPlant | None = None) -> Array:
    """Measured angles (samples, joints) [deg] from the step on; all joints step at the same time."""
    plant = plant or SimulatedPlant(hand, rate_hz, seed)
    controller = Controller(hand, Settings.of(hand, {}))
    controller.enable(True)
    converter = Converter(hand, VELOCITY_TIME_CONSTANT_S)
    pressure = np.zeros(hand.valve_count)
    angles = []
    for number in range(1, round((BEFORE_S + AFTER_S) * rate_hz) + 1):
        counts, supply_v, status = plant.step(pressure)
        now_ns = round(number / rate_hz * 1e9)
        times = Times(now_ns, now_ns, now_ns)
        measured = converter.convert(Frame(number, now_ns // 1000, supply_v, status, counts, now_ns))
        tick = controller.frame(times, measured.position, measured.velocity, measured.pressure)
        assert tick is not None
        pressure = tick.pressure_command.copy()
        for at_s, angle_deg in ((0.05, LOW_DEG), (BEFORE_S, HIGH_DEG)):
            if number == round(at_s * rate_hz):
                target = [math.radians(angle_deg)] * len(hand.joints)
                controller.command(Times(0, now_ns, now_ns), hand.joints, target, [])
        angles.append(np.degrees(measured.position))
    return np.array(angles[round(BEFORE_S * rate_hz) :])


def figures(angles: Array, rate_hz: float) -> tuple[float, float]:
    """Time [s] after which the worst joint of angles (samples, joints) stays within BAND_DEG, and its overshoot [% of
    the step].
    """
    outside = np.abs(angles - HIGH_DEG) > BAND_DEG
    last = np.where(outside.any(axis=0), len(angles) - np.argmax(outside[::-1], axis=0), 0)
    overshoot = (angles.max(axis=0) - HIGH_DEG) / (HIGH_DEG - LOW_DEG) * 100.0
    return float(last.max()) / rate_hz, max(0.0, float(overshoot.max()))
