"""Two models of a hand in one standard motion: what each would measure, over one axis of time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hand_diagnosis.pages.compare import Comparison
from hand_diagnosis.pages.compare_recordings import compare_recordings
from hand_diagnosis.settings import SETTINGS
from hand_identification.excitation import set_points
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_recording.signals import Signals
from hand_sim.plant import PHI, HandPlant, P

MOTION = "staircase"
"""Experiment of `hand excite` that moves every joint over its range in both directions."""


def compare_motions(first: Hand, second: Hand) -> Comparison:
    """Angles as the sensors of each hand read them, without noise, and pressures, under the set-points of the first."""
    names = [joint.removeprefix(first.prefix) for joint in first.joints]
    commands = set_points(
        MOTION,
        first,
        first.joints,
        SETTINGS.compared_motion_s,
        min(SETTINGS.compared_motion_pa, first.supply_pressure_pa),
        0,
    )
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
    return Signals(
        name=hand.name,
        joints=tuple(joints),
        period_s=period_s,
        set_point_pa=given,
        pressure_pa=states[:, P],
        angle_rad=read,
        force_n=none,
        known=known,
        has_set_point=yes,
        has_pressure=yes,
    )


def motion_sentence(rows: Sequence[dict[str, Any]], shown: int) -> str:
    """What both motions show. rows: of compare_motions, the largest difference of the angle first."""
    least_deg, least_kpa = SETTINGS.compared_least
    motion = f"In a simulated {MOTION} of {SETTINGS.compared_motion_s:g} s, with the set-points of A,"
    if not shown:
        return f"{motion} no angle differs by {least_deg:g} degree or more (RMS) and no pressure by {least_kpa:g} kPa."
    worst = rows[0]
    return f"{motion} {worst['joint']} differs most: its angle by {worst['angle_rms']:.3g} degree RMS."
