"""A pressure staircase and steps over 200 s on one joint with the three-zone material law, as in Fig. 13."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hand_identification.joint_data import joint_problem
from hand_identification.joint_problem import JointProblem
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.kernel.rows import ROW
from hand_recording.installed import default_model
from hand_recording.signals import Signals
from hand_sim.plant import PHI, HandPlant, P

JOINT = "thumb_opposition"
PERIOD_S, DURATION_S = 0.01, 200.0
HIGHEST_PA = 3.5e5
ANGLE_NOISE_RAD, PRESSURE_NOISE_PA = np.radians(0.1), 300.0


def description() -> Hand:
    """The hand as shipped: installed, or of this source tree."""
    return load_hand(default_model())


def set_points(seed: int) -> Array:
    """A staircase up and down, then random steps, (T,) [Pa]."""
    rng = np.random.default_rng(seed)
    stairs = np.concatenate([np.linspace(0, HIGHEST_PA, 6), np.linspace(HIGHEST_PA, 0, 6)[1:]])
    steps = rng.uniform(0.0, HIGHEST_PA, 12)
    levels = np.concatenate([stairs, steps])
    count = round(DURATION_S / PERIOD_S)
    return np.repeat(levels, -(-count // len(levels)))[:count]


def recording(hand: Hand, seed: int) -> Signals:
    """What sensors would record of a hand with its material law."""
    rng = np.random.default_rng([seed, 13])
    held = set_points(seed)
    plant = HandPlant(hand, PERIOD_S)
    start = plant.state
    commands = np.repeat(held[:, None], len(hand.joints), axis=1)
    states = np.concatenate([start[None], plant.advance(commands[:-1])])
    j = hand.joints.index(JOINT)
    count = len(held)
    yes = np.ones(1, dtype=bool)
    return Signals(
        name="fig13",
        joints=(JOINT,),
        period_s=PERIOD_S,
        set_point_pa=held[:, None],
        pressure_pa=states[:, P, j : j + 1] + PRESSURE_NOISE_PA * rng.standard_normal((count, 1)),
        angle_rad=states[:, PHI, j : j + 1] + ANGLE_NOISE_RAD * rng.standard_normal((count, 1)),
        force_n=np.full((count, 1), np.nan),
        known=np.ones((count, 1), dtype=bool),
        has_set_point=yes,
        has_pressure=yes,
    )


def without_material(hand: Hand) -> Hand:
    """The same hand without Eq. 11's creep."""
    parameters = hand.parameters.copy()
    parameters[ROW["material.phi_max_deg"]] = 0.0
    return replace(hand, parameters=parameters)


def problem(hand: Hand, seed: int) -> JointProblem:
    """The fit of this recording with a hand's description as nominal model."""
    return joint_problem([recording(description(), seed)], hand, JOINT)
