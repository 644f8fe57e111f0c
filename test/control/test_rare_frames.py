"""Frames that come rarely: the sensors are checked over the elapsed time, or the hand is not driven on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_control.controller import Controller
from hand_control.declared import Settings
from hand_control.sensor_watch import GAP_COUNTS_S, UNCHECKED_S, WARN_S
from hand_control.supervisor import Phase
from hand_messages.health import Level
from hand_model.description import load_hand
from validation.faults.operation import World
from validation.faults.sensor_loop import Loop, Plant
from validation.faults.sensors import Case, study

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
COUNT = len(HAND.joints)
RARE = pytest.mark.parametrize(("rate_hz", "every"), [(50.0, 1), (80.0, 1), (200.0, 5)])


@RARE
def test_a_fault_in_motion_is_found(rate_hz: float, every: int) -> None:
    """Fails when frozen, mirrored or exchanged angles pass at a rate that shows no momentum between two frames."""
    print("seed 41")
    faults = ("angle frozen", "angle mirrored", "angle negated", "angles exchanged")
    for found in study(
        replace(HAND, rate_hz=rate_hz), [Case(0.3, "step", 2, name, False, every) for name in faults], 41
    ):
        assert found.detected_s is not None, found
        assert found.detected_s <= 0.3, found
        assert found.error_deg <= 10.0, found


@RARE
def test_operation_without_a_fault_vents_nothing(rate_hz: float, every: int) -> None:
    """Fails when pushes, contacts, noise or a wrong model vent a hand whose frames come rarely."""
    print("seed 42")
    world, step = World(replace(HAND, rate_hz=rate_hz), 42), Loop.step
    world.loop.step = lambda heard=True: step(world.loop, heard and world.loop.number % every == 0)  # type: ignore[method-assign]
    for _ in range(round(15.0 * rate_hz)):
        world.frame()
        assert world.loop.controller.safety.phase is Phase.ACTIVE, world.loop.controller.safety.fault


def status(loop: Loop) -> tuple[Level, str]:
    return next((h.level, h.message) for h in loop.controller.health(loop.now_ns) if h.name == "sensors")


def test_a_hand_whose_frames_are_too_rare_by_its_description_is_refused() -> None:
    """Fails when such a hand is enabled, only to vent after a second without any check."""
    with pytest.raises(ValueError, match=r"board\.rate_hz is 30; the controller checks the sensors from 33 Hz on"):
        Controller(replace(HAND, rate_hz=30.0), Settings.of(HAND, {}))
    Controller(replace(HAND, rate_hz=33.0), Settings.of(HAND, {}))


@pytest.mark.parametrize("every", [7, 12])
def test_a_hand_whose_sensors_are_not_checked_is_held_then_vented(every: int) -> None:
    """Fails when frames too rare for the checks let a set-point rise, pass without a warning, or for ever."""
    print("seed 43")
    loop, gap_s, waited_s = Loop(HAND, Plant(), 43), every / HAND.rate_hz, 0.0
    loop.controller.enable(True)
    for _ in range(200):
        loop.step()
        loop.command(np.full(COUNT, 0.3))
    assert status(loop) == (Level.OK, "checked")
    loop.command(np.full(COUNT, 1.0))
    held = None
    while waited_s < UNCHECKED_S + 2.0 * gap_s:
        for number in range(every):
            driven = loop.step(number == every - 1)
        waited_s += gap_s
        if not driven:
            break
        if waited_s > WARN_S + gap_s:
            assert held is None or (loop.set_point <= held + 1e-6).all()
            held = loop.set_point.copy()
            level, line = status(loop)
            assert level == Level.WARN
            assert "sensors not checked: frames every" in line and "ms, checks need 30 ms" in line
    assert not driven
    assert UNCHECKED_S <= waited_s <= UNCHECKED_S + 2.0 * gap_s
    assert "sensors not checked for 1 s" in loop.controller.safety.fault


def test_one_gap_counts_for_a_tenth_of_a_second_and_the_warning_ends() -> None:
    """Fails when one stall vents the hand, or when the warning stays after the frames have returned."""
    print("seed 44")
    loop = Loop(HAND, Plant(), 44)
    loop.controller.enable(True)
    loop.step()
    for number in range(400):
        loop.step(not 100 <= number < 390)
    assert loop.controller.safety.phase is Phase.ACTIVE
    assert GAP_COUNTS_S < WARN_S
    for _ in range(200):
        loop.step()
    assert status(loop) == (Level.OK, "checked")


def test_rare_frames_are_named_while_they_last() -> None:
    """Fails when frames too rare for a momentum make the hand slow without a warning."""
    print("seed 45")
    loop = Loop(HAND, Plant(), 45)
    loop.controller.enable(True)
    for number in range(400):
        loop.step(number % 5 == 0)
    level, line = status(loop)
    assert level == Level.WARN
    assert line == "sensors checked less: frames every 25 ms, checks need 12 ms; the set-points rise slowly"
