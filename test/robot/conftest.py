"""The shipped hand, and its mirror image with a prefix."""

from __future__ import annotations

from pathlib import Path

import pytest

from hand_control.grasps import Grasp, load_grasps
from hand_model.description import Hand, load_hand

ROOT = Path(__file__).resolve().parents[2]
CONFIG = ROOT / "config" / "hand.yaml"


@pytest.fixture(scope="session", params=["", "left_"], ids=["right", "left"])
def hand(request: pytest.FixtureRequest) -> Hand:
    return load_hand(CONFIG, request.param)


@pytest.fixture(scope="session")
def grasps(hand: Hand) -> dict[str, Grasp]:
    return load_grasps(CONFIG.with_name("grasps.yaml"), hand)
