"""Friction of a level that builds up over the speed alone is friction; it hides the bend of a finger at first.

The plant is that of links.py, which is independent of the kernel.
"""

from __future__ import annotations

import numpy as np
import pytest

from hand_diagnosis.diagnosis import diagnose
from hand_diagnosis.report import fit_rows
from hand_model.description import load_hand
from hand_model.effects import CATALOGUE
from test.diagnosis.links import FINGER, SmoothFriction, changing_inertia, finger, recorded, run, waves
from test.diagnosis.recordings import CONFIG

SEED = 8
FINE = 24
"""Integration steps of a sample: the fourth order needs fewer than 2.8 inertias / (damping at rest) of time."""
RIVALS = {"coulomb_friction", "viscous_friction", "backlash", "hysteresis", "joint_coupling", "creep"}
WITHOUT = tuple(effect.name for effect in CATALOGUE if effect.keys and effect.name not in RIVALS)
"""The whole catalogue takes minutes."""


@pytest.mark.parametrize(("speed_rad_per_s", "bends"), [(0.5, 0.0), pytest.param(0.1, 1.0, marks=pytest.mark.long)])
def test_friction_that_builds_up_over_the_speed_is_named(speed_rad_per_s: float, bends: float) -> None:
    """Fails when contacts relax too slowly, drag or play stand for friction, or an effect decides on the inertia.

    Asked with plain models, this friction hides that the inertia of the finger changes; where it does not change,
    nothing may say so. Where contacts keep their friction until the motion turns, an error of 3 noise floors is left.
    """
    hand = load_hand(CONFIG)
    rng = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    numbers, u = finger(hand, rng, 0.03), np.clip(1.25 * waves(rng, 20.0), 0.0, 4.5e5)
    friction = SmoothFriction(0.004, speed_rad_per_s)
    pressures, angles = run(numbers, u, bends * changing_inertia(hand), friction, FINE)
    signals = recorded(u, pressures, angles, rng)
    result = diagnose([signals], hand, tolerance=0.05, seed=0, sensor_curve=False, without=WITHOUT, joints=[FINGER[1]])
    (finding,) = result.findings
    rows = [row for row in fit_rows(result) if row["signal"] == "angle" and row["split"] != "train"]
    print(result.verdict, finding.probability, [row["rmse_after"] / row["noise_floor"] for row in rows])
    assert (result.verdict, finding.effect) == ("explained", "coulomb_friction")
    assert any("changes with the angle of the distal joint" in line for line in result.check) == bool(bends)
    assert all(row["rmse_after"] < 2.0 * row["noise_floor"] for row in rows)
