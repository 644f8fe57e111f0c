"""A recording of the whole simulated hand, for the tests of this folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_model.description import load_hand
from hand_recording.replay import record_offline

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def short_recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bare .mcap of the whole simulated hand stepping for 12 s."""
    hand = load_hand(ROOT / "config" / "hand.yaml")
    levels = np.random.default_rng(11).uniform(0.0, 3.5e5, (12, len(hand.joints)))
    out = tmp_path_factory.mktemp("recording") / "steps.mcap"
    for _ in record_offline(hand, np.repeat(levels, 200, axis=0), out, seed=11):
        pass
    return out
