"""The pressure-control valve of two switching valves: ISO 6358 flow, the loop, and the whole hand on it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_model.description import load_hand
from hand_model.effects.effect import ATMOSPHERE_PA
from hand_model.pressure_loop import open_rate
from hand_sim.plant import PHI, HandPlant, P

CONFIG = Path(__file__).parents[2] / "config" / "hand.yaml"
HIGH_PA = 7e5


def switching(tmp_path: Path) -> HandPlant:
    path = tmp_path / "hand.yaml"
    path.write_text(CONFIG.read_text(encoding="utf-8").replace("valve_kind: analog", "valve_kind: switching"))
    return HandPlant(load_hand(path), 0.005)


def test_flow_is_choked_then_an_ellipse() -> None:
    """Fails when the flow does not follow ISO 6358-1: constant below b, zero at equal pressures."""
    full = open_rate(HIGH_PA, 0.2 * HIGH_PA, 1e-9, 0.3, 1e-6)
    assert full == pytest.approx(1e5 * 1e-9 * HIGH_PA / 1e-6)
    assert open_rate(HIGH_PA, 0.3 * HIGH_PA, 1e-9, 0.3, 1e-6) == pytest.approx(full)
    middle = open_rate(HIGH_PA, 0.65 * HIGH_PA, 1e-9, 0.3, 1e-6)
    assert middle == pytest.approx(full * np.sqrt(1.0 - 0.5**2))
    assert open_rate(ATMOSPHERE_PA, ATMOSPHERE_PA, 1e-9, 0.3, 1e-6) == 0.0


def test_the_loop_follows_set_points_without_cycling(tmp_path: Path) -> None:
    """Fails when the loop leaves an error, hunts at rest, or is slower than the analog valve by far."""
    plant = switching(tmp_path)
    for target in (1e5, 3e5, 2.9e5, 5e5, 0.4e5):
        out = plant.advance(np.full((400, 11), target))
        settled = out[300:, P]
        assert np.abs(settled - target).max() < 4e3, target
        assert (np.abs(np.diff(settled, axis=0)) > 500.0).sum(axis=0).max() <= 2, target
        reached = np.argmax(np.abs(out[:, P] - target) < 0.1 * target, axis=0)
        assert reached.max() * 0.005 < 0.5
    assert np.isfinite(plant.state).all()
    assert plant.state[PHI].max() < np.radians(100.0)
