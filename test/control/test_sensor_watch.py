"""Sensors that contradict the motion: found with their line, and no false vent under pushes, contacts and gaps."""

from __future__ import annotations

import numpy as np
import pytest

from hand_model.description import load_hand
from validation.faults.operation import World
from validation.faults.sensors import CONFIG, Case, Outcome, study

HAND = load_hand(CONFIG / "hand.yaml")


def found(error: float, motion: str, joint: int, name: str, from_start: bool, seed: int) -> Outcome:
    print(f"seed {seed}")
    return study(HAND, [Case(error, motion, joint, name, from_start)], seed)[0]


@pytest.mark.parametrize("error", [0.0, 0.1, 0.3])
@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("angle frozen", ""),
        ("angle negated", ""),
        ("converter stuck", ""),
        ("supply 6.5 V", "not a number"),
        ("pressures exchanged", "exchanged"),
    ],
)
def test_a_fault_in_motion_is_found(error: float, name: str, part: str) -> None:
    """Fails when a fault is found later than 0.3 s, moves a joint out of its way by 10 degrees, or is misnamed."""
    outcome = found(error, "step", 4, name, False, 300 + round(100 * error))
    assert outcome.detected_s is not None
    assert outcome.detected_s <= 0.3
    assert outcome.error_deg <= 10.0
    assert part in outcome.line


@pytest.mark.parametrize("joint", [1, 6])
@pytest.mark.parametrize(("name", "part"), [("angle mirrored", "polarity"), ("angle negated", "")])
def test_wrong_wiring_is_found_in_the_first_motion(joint: int, name: str, part: str) -> None:
    """Fails when a sensor with the wrong sign or place is not found, or is not named with what to check."""
    outcome = found(0.1, "step", joint, name, True, 320 + joint)
    assert outcome.detected_s is not None
    assert outcome.error_deg <= 15.0
    assert HAND.joints[joint] in outcome.line
    assert part in outcome.line


@pytest.mark.parametrize("seed", [101, 102])
def test_operation_without_a_fault_vents_nothing(seed: int) -> None:
    """Fails when pushes, contacts, gaps, noise or a wrong model vent the hand."""
    print(f"seed {seed}")
    world = World(HAND, seed)
    for _ in range(3000):
        assert world.frame(), world.loop.controller.safety.fault


def test_the_set_points_do_not_rise_under_suspicion() -> None:
    """Fails when the pressure rises on while an angle stands still to the last bit."""
    outcome = found(0.3, "step", 6, "angle frozen", False, 340)
    assert outcome.excess_pa < 6e4
    assert np.isfinite(outcome.error_deg)
