"""Gaps in the frames are gaps: no jump, no contact in empty air; and a liquid is no valve that does not follow."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_control.controller import Controller
from hand_control.declared import Settings
from hand_control.frame_checks import (
    FASTEST_RAD_PER_S,
    FINE,
    FOLLOWING,
    JUMP_S,
    JUMPED,
    STUCK_LOW,
    PressureWatch,
    allowed_jump,
)
from hand_control.frame_watch import FrameWatch
from hand_control.supervisor import Phase
from hand_model.description import load_hand
from validation.faults.sensor_loop import Loop, Plant

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
COUNT = len(HAND.joints)


WATCHED = 17
"""Missing frames of the longest gap, 90 ms, in which the watch for silence must trip nothing."""


def test_the_allowed_jump_grows_with_the_time_that_is_missing() -> None:
    """Fails when a gap is a jump, or two frames at the usual distance allow more than the parameter."""
    assert allowed_jump(0.5, 0.005) == 0.5
    assert allowed_jump(0.5, 0.0925) == pytest.approx(0.5 + 0.085 * FASTEST_RAD_PER_S)
    assert allowed_jump(0.5, math.inf) == math.inf


@pytest.mark.parametrize("rate_hz", [50.0, 100.0, 200.0, 1000.0])
def test_a_jump_is_the_same_speed_at_every_frame_rate(rate_hz: float) -> None:
    """Fails when a joint that an obstacle lets go jumps because its frames are rare, or twice that passes."""
    watch, still = FrameWatch(replace(HAND, rate_hz=rate_hz)), np.zeros(COUNT)
    fastest = np.radians(30.0) + FASTEST_RAD_PER_S * max(1.0 / rate_hz - JUMP_S, 0.0)
    for share, verdict in ((0.99, FINE), (1.01, JUMPED)):
        watch.start(still, still, still)
        measured = (np.where(np.arange(COUNT) == 3, share * fastest, 0.0), still, still)
        found = watch.check(measured, still, np.radians(30.0), 1.0 / rate_hz)
        assert found.plausible == verdict


def driven_with_gaps(gap_frames: int, every: int, seed: int, error: float) -> tuple[Loop, int, list[int]]:
    """A hand in fast motion that loses gap_frames frames out of `every`; the loop, frames driven, contact events."""
    print(f"seed {seed}")
    loop, rng, contacts, driven = Loop(HAND, Plant(error), seed), np.random.default_rng(seed), [], 0
    loop.controller.enable(True)
    for number in range(2400):
        heard = number % every < every - gap_frames
        if number % 200 == 1:
            loop.step()
            loop.command(np.radians(rng.uniform(0.0, 80.0, COUNT)))
        driving = loop.step(heard)
        if gap_frames <= WATCHED and not heard:
            loop.controller.check(loop.now_ns)
            driving = loop.controller.safety.phase is Phase.ACTIVE
        if not driving:
            break
        driven += 1
        contacts += [event.joint for event in loop.controller.contacts() if event.touching]
    return loop, driven, contacts


@pytest.mark.parametrize(("gap_frames", "every"), [(17, 60), (17, 37), (8, 23), (99, 431)])
def test_gaps_and_stalls_in_fast_motion_trip_nothing(gap_frames: int, every: int) -> None:
    """Fails when a gap of 90 ms, with the watch for silence, or a stall of 0.5 s without it latches a fault."""
    loop, driven, _ = driven_with_gaps(gap_frames, every, 91 + gap_frames, 0.3)
    assert loop.controller.safety.fault == ""
    assert driven == 2400


@pytest.mark.parametrize(("frames", "fault"), [(19, ""), (20, "no usable sensor data")])
def test_a_stall_after_which_the_watch_comes_first_vents_from_100_ms_on(frames: int, fault: str) -> None:
    """Fails when a node that was stopped vents before 0.1 s, or goes on after more although its data are too old."""
    loop, _, _ = driven_with_gaps(0, 60, 5, 0.0)
    for _ in range(frames):
        loop.step(heard=False)
    assert loop.controller.safety.fault == ""
    loop.now_ns += 1
    loop.controller.check(loop.now_ns)
    assert loop.controller.safety.fault.startswith(fault) and bool(loop.controller.safety.fault) == bool(fault)


@pytest.mark.parametrize(("gap_frames", "every"), [(17, 60), (8, 46)])
def test_gaps_in_empty_air_are_no_contacts(gap_frames: int, every: int) -> None:
    """Fails when gaps bring more contacts than the same motion without gaps, by more than chance."""
    whole = sum(len(driven_with_gaps(0, every, seed, 0.0)[2]) for seed in (7, 8))
    broken = sum(len(driven_with_gaps(gap_frames, every, seed, 0.0)[2]) for seed in (7, 8))
    assert broken <= whole + 1


@pytest.mark.parametrize("error", [0.1, 0.2, 0.3])
@pytest.mark.parametrize("liquid_described", [True, False])
def test_a_hydraulic_hand_never_trips(error: float, liquid_described: bool) -> None:
    """Fails when displaced liquid counts as a valve that does not follow, also where the description says air."""
    seed = round(100 * error)
    print(f"seed {seed}")
    loop, rng = Loop(HAND, Plant(error, liquid=True), seed), np.random.default_rng(seed)
    if not liquid_described:
        loop.controller = Controller(HAND, Settings.of(HAND, {}))
    loop.controller.enable(True)
    loop.step()
    for number in range(2400):
        if number % 300 == 0:
            loop.command(np.radians(rng.uniform(0.0, 80.0, COUNT)))
        assert loop.step(), loop.controller.safety.fault


def test_a_dead_valve_of_a_hydraulic_hand_is_found() -> None:
    """Fails when the allowance for the liquid hides a valve that gives no pressure to a joint at rest."""
    watch = PressureWatch(HAND)
    watch.start(np.zeros(COUNT), np.zeros(COUNT))
    verdicts = [watch.check(np.full(COUNT, 1e5), np.zeros(COUNT), 0.005, np.zeros(COUNT))[0] for _ in range(160)]
    assert verdicts[10] == FOLLOWING
    assert verdicts[-1] == STUCK_LOW
