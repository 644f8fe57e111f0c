"""All tests of a frame in one call: the same verdicts and limits as test by test."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_control.frame_checks import FINE, FOLLOWING, JUMPED, NOT_FINITE, OVER_PRESSURE, STEPPED, STUCK_LOW
from hand_control.frame_watch import NOTHING, Findings, FrameWatch
from hand_control.step_watch import FROZEN
from hand_model.arrays import Array
from hand_model.description import load_hand

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
COUNT, DT_S, JUMP_RAD, SEED = len(HAND.joints), 0.005, 0.3, 7
JOINT = 4


def frames(fault: str, count: int = 600) -> list[tuple[Array, Array, Array, Array, float]]:
    """Position [rad], velocity [rad/s], pressure [Pa], set-points [Pa] and elapsed time [s] of a hand in motion."""
    rng = np.random.default_rng(SEED)
    found: list[tuple[Array, Array, Array, Array, float]] = []
    for k in range(count):
        time_s = k * DT_S
        position = 0.6 + 0.3 * np.sin(4.0 * time_s + np.arange(COUNT)) + 1e-4 * rng.standard_normal(COUNT)
        velocity = 1.2 * np.cos(4.0 * time_s + np.arange(COUNT))
        pressure = 1.5e5 + 200.0 * rng.standard_normal(COUNT)
        command = np.full(COUNT, 1.5e5)
        elapsed_s = DT_S
        if k >= count // 2:
            if fault == "nan":
                position[JOINT] = np.nan
            elif fault == "jump" and k == count // 2:
                position[JOINT] += 0.5
            elif fault == "over":
                rise = 5e3 * (k - count // 2)
                pressure[JOINT] = command[JOINT] = min(1.5e5 + rise, 1.2 * HAND.limits.max_pressure_pa[JOINT])
            elif fault == "low":
                pressure[JOINT] = max(1.5e5 - 5e3 * (k - count // 2), 2e4)
            elif fault == "stepped":
                pressure[JOINT] = 0.5 * pressure[JOINT]
            elif fault == "frozen":
                position[JOINT] = found[count // 2 - 1][0][JOINT]
            elif fault == "gap" and k % 50 == 0:
                elapsed_s = 0.15
        found.append((position, velocity, pressure, command, elapsed_s))
    return found


def watched(frame_list: list[tuple[Array, Array, Array, Array, float]], by_test: bool) -> tuple[list[Findings], Array]:
    """Findings of every frame and the limited set-points (frames, joints) [Pa]."""
    watch = FrameWatch(HAND)
    if by_test:
        watch._longest_s = 0.0
    position, velocity, pressure, command, _ = frame_list[0]
    watch.start(position, velocity, pressure)
    found, held = [], []
    for position, velocity, pressure, command, elapsed_s in frame_list[1:]:
        limited = command.copy()
        found.append(watch.check((position, velocity, pressure), command, JUMP_RAD, elapsed_s))
        watch.hold(limited)
        held.append(limited)
    return found, np.array(held)


@pytest.mark.parametrize("fault", ["none", "nan", "jump", "over", "low", "stepped", "frozen", "gap"])
def test_a_call_for_all_finds_what_each_finds(fault: str) -> None:
    """Fails when the call for regular frames differs from test by test: in a verdict, a joint, or a limit."""
    print(f"seed {SEED}")
    frame_list = frames(fault)
    together, held = watched(frame_list, by_test=False)
    apart, held_apart = watched(frame_list, by_test=True)
    assert together == apart
    assert np.array_equal(held, held_apart)


@pytest.mark.parametrize(
    ("fault", "plausible", "pressure"),
    [
        ("none", FINE, FOLLOWING),
        ("nan", NOT_FINITE, FOLLOWING),
        ("jump", JUMPED, FOLLOWING),
        ("over", FINE, OVER_PRESSURE),
        ("low", FINE, STUCK_LOW),
        ("stepped", FINE, STEPPED),
    ],
)
def test_each_fault_gets_its_verdict(fault: str, plausible: int, pressure: int) -> None:
    """Fails when a fault passes, or is put on another joint."""
    found = [each for each in watched(frames(fault), by_test=False)[0] if each.contradiction is None]
    worst = max(found, key=lambda each: (each.plausible != FINE) + (each.pressure != FOLLOWING))
    assert (worst.plausible, worst.pressure) == (plausible, pressure)
    if fault == "none":
        assert all(each is NOTHING for each in found)
    else:
        assert JOINT in (worst.implausible_joint, worst.pressure_joint)


def test_a_frozen_angle_is_found() -> None:
    """Fails when the sensors are not watched in regular frames: this motion has none of the pressure's reasons."""
    found = {
        fault: {each.contradiction[:2] for each in watched(frames(fault), by_test=False)[0] if each.contradiction}
        for fault in ("none", "frozen")
    }
    assert (FROZEN, JOINT) in found["frozen"] - found["none"]
