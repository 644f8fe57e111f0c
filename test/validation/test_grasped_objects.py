"""Grasps of objects by the whole controller, on plants of another form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_control.grasps import load_grasps
from hand_model.description import load_hand
from validation.bench.bench_grasp import PATTERN, grasp_of

CONFIG = Path(__file__).resolve().parents[2] / "config"
HAND = load_hand(CONFIG / "hand.yaml")
GRASPS = load_grasps(CONFIG / "grasps.yaml", HAND)


@pytest.mark.parametrize("stiffness_nm_per_rad", [100.0, 5.0])
def test_a_grasp_holds_its_torque_and_opens_at_once(stiffness_nm_per_rad: float) -> None:
    """Fails when a joint misses its object or its torque, or an opening joint goes on pressing (plants of hand 3)."""
    done = grasp_of(HAND, GRASPS[PATTERN], stiffness_nm_per_rad, 0.02, 3)
    assert done.ended and not done.fault and done.touched.sum() >= 8
    assert done.reported[done.touched].all()
    np.testing.assert_allclose(done.held[done.touched], 1.0, atol=0.1)
    assert done.release_s[done.touched].max() < 0.35
