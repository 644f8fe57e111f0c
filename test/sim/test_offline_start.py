"""The state in which a replay begins: what was measured, and nothing that it does not show."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_model.description import Hand, load_hand
from hand_model.kernel.rows import ROW
from hand_recording.replay import simulate_recording
from hand_sim.offline import Commands, Measured, initial_state, replay
from hand_sim.plant import CREEP, OMEGA, PHI, P

SEED = 4


@pytest.fixture(scope="module")
def hand() -> Hand:
    """The hand of the description."""
    return load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")


def measured_of(hand: Hand, states: np.ndarray) -> Measured:
    """Frames as the sensors of the hand read these states, with noise."""
    rng = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    read = hand.sensors.angle_line.angle_rad(hand.sensors.hall.ratio(states[:, PHI]))
    angle_rad = read + np.radians(0.01) * rng.standard_normal(read.shape)
    pressure_pa = states[:, P] + 30.0 * rng.standard_normal(read.shape)
    stamp_ns = np.round(np.arange(len(states)) * 1e9 / hand.rate_hz).astype(np.int64)
    return Measured(stamp_ns, angle_rad, states[:, OMEGA], pressure_pa)


def test_commands_that_a_recorder_missed_are_not_taken_for_none(hand: Hand) -> None:
    """Fails when a hand that was held by unrecorded set-points is replayed as vented, and the difference as creep."""
    held_pa = np.repeat(np.repeat([0.0, 150.0, 9e4], (60, 500, 600))[:, None], len(hand.joints), axis=1)
    made = simulate_recording(hand, held_pa)
    heard = 540
    commands = Commands(made.commands.sent_ns - made.stamp_ns[0], held_pa, made.commands.lifetime_s)
    late = Commands(commands.sent_ns[heard:], commands.pressure_pa[heard:], commands.lifetime_s[heard:])
    _, states = replay(hand, measured_of(hand, made.states), late)
    error_deg = np.degrees(states[:, PHI] - made.states[-len(states) :, PHI])
    assert len(states) >= len(made.states) - heard - 2
    assert np.abs(error_deg[100:]).max() < 0.05


def test_the_load_of_an_end_stop_is_no_creep(hand: Hand) -> None:
    """Fails when a joint that a load presses onto its end stop begins with creep, and is then degrees off."""
    parameters = hand.parameters.copy()
    parameters[ROW["constant_load.torque_nm"]] = 0.05
    loaded = replace(hand, parameters=parameters)
    made = simulate_recording(loaded, np.zeros((200, len(hand.joints))))
    assert np.all(initial_state(loaded, measured_of(loaded, made.states))[CREEP] == 0.0)
