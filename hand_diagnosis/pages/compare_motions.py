"""Two models of a hand in one standard motion: what each would measure, over one axis of time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hand_diagnosis.pages.compare import Comparison
from hand_diagnosis.pages.compare_recordings import compare_recordings
from hand_identification.excitation import set_points
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_recording.signals import Signals
from hand_sim.plant import PHI, HandPlant, P

MOTION, MOTION_S = "staircase", 20.0
"""Experiment of `hand excite` that moves every joint over its range in both directions, and its duration [s]."""
MOTION_PA = 4e5
"""Largest set-point of the motion, as that of `hand excite`."""
SHOWN_DEG, SHOWN_KPA = 0.05, 0.3
"""RMS differences of angle and pressure from which a joint is drawn: the practical floor of the diagnosis."""


def compare_motions(first: Hand, second: Hand) -> Comparison:
    """Angles as the sensors of each hand read them, without noise, and pressures, under the set-points of the first."""
    names = [joint.removeprefix(first.prefix) for joint in first.joints]
    commands = set_points(MOTION, first, first.joints, MOTION_S, min(MOTION_PA, first.supply_pressure_pa), 0)
    period_s = 1.0 / first.rate_hz
    a, b = (_simulated(hand, names, commands, period_s) for hand in (first, second))
    return compare_recordings(a, b)


def _simulated(hand: Hand, names: Sequence[str], commands: Array, period_s: float) -> Signals:
    """A hand at rest under set-points (T, names) [Pa]; those of joints that it does not have are left out."""
    joints = [joint.removeprefix(hand.prefix) for joint in hand.joints]
    given = np.zeros((len(commands), len(joints)))
    for j, joint in enumerate(joints):
        if joint in names:
            given[:, j] = commands[:, names.index(joint)]
    plant = HandPlant(hand, period_s)
    states = np.concatenate([plant.state[None], plant.advance(given[:-1])])
    sensors, known = hand.sensors, np.ones(given.shape, dtype=bool)
    read = sensors.angle_line.angle_rad(sensors.hall.ratio(states[:, PHI]))
    none, yes = np.full(given.shape, np.nan), np.ones(len(joints), dtype=bool)
    return Signals(hand.name, tuple(joints), period_s, given, states[:, P], read, none, known, yes, yes)


def motion_sentence(rows: Sequence[dict[str, Any]], shown: int) -> str:
    """What both motions show. rows: of compare_motions, the largest difference of the angle first."""
    motion = f"In a simulated {MOTION} of {MOTION_S:g} s, with the set-points of A,"
    if not shown:
        return f"{motion} no angle differs by {SHOWN_DEG:g} degree or more (RMS) and no pressure by {SHOWN_KPA:g} kPa."
    worst = rows[0]
    return f"{motion} {worst['joint']} differs most: its angle by {worst['angle_rms']:.3g} degree RMS."
