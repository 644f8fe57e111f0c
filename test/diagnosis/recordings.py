"""Recordings of hands that differ from their nominal model in one known way, made without ROS."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from typer.testing import CliRunner, Result

from hand_identification.free_parameters import NOMINAL_KEYS
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.kernel.rows import ROW
from hand_recording.signals import Signals
from hand_sim.plant import PHI, HandPlant, P
from hand_tool.cli import app

CONFIG = Path(__file__).resolve().parents[2] / "config" / "hand.yaml"
PERIOD_S = 0.005
ANGLE_NOISE_RAD, PRESSURE_NOISE_PA = np.radians(0.03), 150.0


def changed(hand: Hand, joint: str, **values: float) -> Hand:
    """The hand with parameters of one joint changed, SI; __ stands for the dot."""
    parameters = hand.parameters.copy()
    for key, value in values.items():
        parameters[ROW[key.replace("__", ".")], hand.joints.index(joint)] = value
    return replace(hand, parameters=parameters)


def off_by_a_little(hand: Hand, rng: np.random.Generator, share: float = 0.03) -> Hand:
    """A realistic nominal model: every parameter is wrong by a few percent."""
    parameters = hand.parameters.copy()
    for key in NOMINAL_KEYS:
        if key != "dynamics.coupling_inertia_kg_m2":
            parameters[ROW[key]] *= 1.0 + share * rng.standard_normal(len(hand.joints))
    return replace(hand, parameters=parameters)


def excitation(rng: np.random.Generator, seconds: float, joints: int) -> np.ndarray:
    """Staircase, slow triangle, random steps and multisine, a quarter each."""
    count = round(seconds / PERIOD_S / 4)
    time = np.arange(count) * PERIOD_S
    commands = np.empty((4 * count, joints))
    for j in range(joints):
        levels = np.r_[np.linspace(0, 4e5, 5), np.linspace(3e5, 0, 4)]
        commands[:count, j] = np.repeat(levels, count // 9 + 1)[:count]
        phase = 1.5 * time / time[-1] + rng.uniform()
        commands[count : 2 * count, j] = 4e5 * np.abs(2.0 * (phase % 1.0) - 1.0)
        commands[2 * count : 3 * count, j] = np.repeat(rng.uniform(0, 4.2e5, count // 120 + 1), 120)[:count]
        waves = [5e4 * np.sin(2 * np.pi * f * time + rng.uniform(0, 6)) for f in np.geomspace(0.1, 4, 8)]
        commands[3 * count :, j] = np.clip(2e5 + np.sum(waves, axis=0), 0, 4.5e5)
    return commands


def record(truth: Hand, rng: np.random.Generator, seconds: float = 44.0) -> Signals:
    """The recording that noisy sensors make of the hand."""
    joints = len(truth.joints)
    commands = excitation(rng, seconds, joints)
    plant = HandPlant(truth, PERIOD_S)
    states = np.concatenate([plant.state[None], plant.advance(commands[:-1])])
    shape, yes = commands.shape, np.ones(joints, dtype=bool)
    return Signals(
        name="simulated",
        joints=truth.joints,
        period_s=PERIOD_S,
        set_point_pa=commands,
        pressure_pa=states[:, P] + PRESSURE_NOISE_PA * rng.standard_normal(shape),
        angle_rad=states[:, PHI] + ANGLE_NOISE_RAD * rng.standard_normal(shape),
        force_n=np.full(shape, np.nan),
        known=np.ones(shape, dtype=bool),
        has_set_point=yes,
        has_pressure=yes,
    )


def hand_tool(*arguments: str) -> Result:
    """The command `hand` in this process."""
    return CliRunner().invoke(app, list(arguments))


def recorded_alone(hand: Hand, commands: Array, joint: str = "index_distal") -> Signals:
    """A recording at 100 Hz of one joint alone under set-points (T, 11) [Pa], without noise."""
    plant = HandPlant(hand, 0.01)
    states = np.concatenate([plant.state[None], plant.advance(commands[:-1])])
    j, yes = hand.joints.index(joint), np.ones(1, dtype=bool)
    pressure, angle = states[:, P, j : j + 1], states[:, PHI, j : j + 1]
    none, known = np.full_like(angle, np.nan), np.ones_like(angle, dtype=bool)
    return Signals(
        name="steps",
        joints=(joint,),
        period_s=0.01,
        set_point_pa=commands[:, j : j + 1],
        pressure_pa=pressure,
        angle_rad=angle,
        force_n=none,
        known=known,
        has_set_point=yes,
        has_pressure=yes,
    )
