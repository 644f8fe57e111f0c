"""What board_state says of channels that measure nothing: the sensor, the channel, the evidence and what to check."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from hand_driver.board import Frame, Status
from hand_driver.board_report import Reporter
from hand_driver.channel_faults import SHOWN, ChannelFaults
from hand_driver.channel_watch import BLOCK, ChannelWatch
from hand_driver.measurement import Converter, channel_names
from hand_model.description import load_hand
from hand_sim.plant import SimulatedPlant

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
JOINT = HAND.joints[3]
ANGLE = int(HAND.sensors.angle_channel[3])
SEED = 43
FINE = Status(0)


def resting(frames: int) -> np.ndarray:
    print(f"seed {SEED}")
    plant = SimulatedPlant(HAND, 200.0, SEED)
    return np.array([plant.step(np.zeros(HAND.valve_count))[0] for _ in range(frames)])


def lines(counts: np.ndarray, watch: ChannelWatch, supply_v: float = 5.0, status: Status = FINE) -> tuple[str, ...]:
    """The lines of a frame, as the driver makes them."""
    frame = Frame(1, 5000, supply_v, status, counts, 0)
    disbelieved = watch.check(counts)
    measured = Converter(HAND, 0.0).convert(frame, disbelieved)
    return ChannelFaults(HAND).lines(frame, measured.at_rail, None if disbelieved is None else watch)


def test_a_hand_that_is_measured_has_no_line() -> None:
    """Fails when a healthy channel is called faulty: the hand could not be enabled."""
    watch = ChannelWatch(HAND)
    assert {lines(counts, watch) for counts in resting(20)} == {()}


def test_a_stuck_channel_has_a_line_with_evidence_and_check() -> None:
    """Fails when the line lacks the joint, the channel, the readings or what to check."""
    frames, watch = resting(3 * BLOCK + 40), ChannelWatch(HAND)
    frames[3 * BLOCK :, ANGLE] = held = frames[3 * BLOCK, ANGLE]
    said = [lines(counts, watch) for counts in frames]
    assert said[3 * BLOCK] == ()
    (line,) = said[-1]
    assert line.startswith(f"{JOINT} angle (channel {ANGLE}): ")
    assert f"equal readings of {held} counts" in line and "check the sensor" in line


def test_a_broken_wire_has_a_line_with_its_count() -> None:
    """Fails when a channel at its rail is not named with its number and reading."""
    counts = resting(1)[0]
    counts[ANGLE] = 65535
    (line,) = lines(counts, ChannelWatch(HAND))
    assert line.startswith(f"{JOINT} angle (channel {ANGLE}): at the rail, 65535 of ")
    assert "check for a broken wire" in line


@pytest.mark.parametrize(
    ("supply_v", "status", "evidence"),
    [(3.0, FINE, "3.00 V"), (math.nan, FINE, "nan V"), (5.0, Status.ADC_FAULT, "failed conversion")],
)
def test_a_common_cause_is_one_line(supply_v: float, status: Status, evidence: str) -> None:
    """Fails when a lost supply or a failed converter is blamed on single channels, or has no line."""
    (line,) = lines(resting(1)[0], ChannelWatch(HAND), supply_v, status)
    assert line.startswith("every channel: ") and evidence in line and "check" in line


def test_the_number_of_lines_is_bounded() -> None:
    """Fails when a message about a board without sensors grows with the hand beyond what the controller reads."""
    counts = np.full(HAND.channel_count, 65535, dtype=np.uint16)
    names = list(channel_names(HAND).values()) * 4
    said = ChannelFaults(HAND).lines(Frame(1, 5000, 5.0, FINE, counts, 0), names, None)
    assert len(said) == SHOWN + 1
    assert said[-1].startswith(f"and {len(names) - SHOWN} more channels")


def test_a_new_fault_is_published_at_once_and_a_longer_run_is_not() -> None:
    """Fails when the controller learns of a channel late, or gets a message with every frame while it is stuck."""
    reporter, frame = Reporter(), Frame(1, 5000, 5.0, FINE, resting(1)[0], 0)
    reporter.frame(frame, 0.0)
    assert reporter.due(2, True, "", 0.0) is not None
    reporter.frame(frame, 0.005, ("a angle (channel 3): 14 equal readings",))
    report = reporter.due(2, True, "", 0.005)
    assert report is not None and report.channels == ("a angle (channel 3): 14 equal readings",)
    reporter.frame(frame, 0.010, ("a angle (channel 3): 15 equal readings",))
    assert reporter.due(2, True, "", 0.010) is None
    reporter.frame(frame, 0.015)
    report = reporter.due(2, True, "", 0.015)
    assert report is not None and report.channels == ()
