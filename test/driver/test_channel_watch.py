"""Channels that repeat their counts: found when chance does not explain it, and only then."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from hand_driver.board import Frame, LinkCounters, Status
from hand_driver.channel_watch import BLOCK, FALSE_ALARMS_PER_HOUR, FLOOR, ChannelWatch
from hand_driver.driver_health import DriverHealth, LinkState
from hand_driver.measurement import Converter
from hand_messages.health import Health, Level
from hand_model.description import load_hand
from hand_sim.offline import without_noise
from hand_sim.plant import SimulatedPlant

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
ANGLE_3, PRESSURE_4 = int(HAND.sensors.angle_channel[3]), int(HAND.sensors.pressure_channel[4])
SEED = 41
VENTED = np.zeros(len(HAND.joints))
# The rule written out: at a share of 0.1 this many repeats are less likely than 1e-6 an hour on any channel.
RUN = math.ceil(math.log(FALSE_ALARMS_PER_HOUR / (3600 * 200 * 34)) / math.log(FLOOR))


def resting(frames: int, seed: int = SEED, noise: float = 1.0) -> np.ndarray:
    """Counts (frames, channels) of the vented hand with so many times its noise."""
    print(f"seed {seed}")
    plant = SimulatedPlant(HAND, 200.0, seed)
    plant._channels.noise_v *= noise
    return np.array([plant.step(VENTED)[0] for _ in range(frames)])


def first_fault(watch: ChannelWatch, frames: np.ndarray) -> tuple[int, list[int]]:
    """Index of the first frame with a channel that is not believed, and these channels; (-1, []) for none."""
    for index, counts in enumerate(frames):
        faulty = watch.check(counts)
        if faulty is not None:
            return index, np.flatnonzero(faulty).tolist()
    return -1, []


def learned() -> ChannelWatch:
    watch = ChannelWatch(HAND)
    assert first_fault(watch, resting(3 * BLOCK)) == (-1, [])
    return watch


@pytest.mark.parametrize("channel", [ANGLE_3, PRESSURE_4])
def test_a_stuck_channel_is_found_at_the_run_that_chance_excludes(channel: int) -> None:
    """Fails when a frozen channel is found later than the rule says, or another one is not believed."""
    frames = resting(100, SEED + 1)
    frames[5:, channel] = frames[4, channel]
    index, found = first_fault(learned(), frames)
    assert found == [channel]
    assert RUN == 14
    assert index - 4 == pytest.approx(RUN, abs=2)  # the learned share may lie a little above the floor


def test_a_converter_that_repeats_frames_is_found_within_four() -> None:
    """Fails when old frames pass as new ones, or the fault is blamed on single channels."""
    frames, watch = resting(50, SEED + 2), learned()
    frames[10:] = frames[9]
    index, found = first_fault(watch, frames)
    assert (index - 9, len(found)) == (3, HAND.channel_count)
    assert len(watch.lines) == 1 and "the converter repeated the same frame" in watch.lines[0]


def test_a_frame_read_twice_is_no_fault_but_a_slow_converter_is_named() -> None:
    """Fails when one repeated frame stops the hand, or a converter at half the rate stays unnoticed."""
    watch = learned()
    frames = np.repeat(resting(2 * BLOCK, SEED + 3), 2, axis=0)
    assert first_fault(watch, frames) == (-1, [])
    assert watch.repeated_share == pytest.approx(0.5, abs=0.02)
    said = channels(watch)
    assert (said.level, "repeats 50 % of the frames" in said.message) == (Level.WARN, True)


def test_a_channel_that_is_dead_from_the_start_is_found_after_two_seconds() -> None:
    """Fails when a channel that never showed its noise is believed for ever."""
    frames = resting(450)
    frames[:, ANGLE_3] = 31000
    index, found = first_fault(ChannelWatch(HAND), frames)
    assert found == [ANGLE_3]
    assert index == 400


def test_a_hand_without_noise_is_usable_and_says_that_it_is_not_watched() -> None:
    """Fails when the simulated hand without noise is called stuck at rest."""
    hand = without_noise(HAND)
    watch, counts = ChannelWatch(hand), SimulatedPlant(hand, 200.0).step(VENTED)[0]
    assert first_fault(watch, np.repeat(counts[None], 2000, axis=0)) == (-1, [])
    assert len(watch.unwatched) == HAND.channel_count


def test_a_quieter_channel_than_described_needs_a_longer_run() -> None:
    """Fails when a real channel that often repeats its counts is called stuck by chance."""
    watch = ChannelWatch(HAND)
    assert first_fault(watch, resting(40 * BLOCK, SEED + 4, noise=0.08)) == (-1, [])
    frames = resting(2000, SEED + 5, noise=0.08)
    frames[:, ANGLE_3] = frames[0, ANGLE_3]
    index, found = first_fault(watch, frames)
    assert ANGLE_3 in found and index > 2 * RUN


@pytest.mark.parametrize("noise", [1.0, 5.0])
def test_noise_alone_never_trips(noise: float) -> None:
    """Fails when chance repeats trip within 200,000 readings of every channel."""
    plant_noise = resting(6000, SEED + 6, noise)
    watch, rng = ChannelWatch(HAND), np.random.default_rng(SEED)
    for _ in range(3):
        shuffled = rng.permuted(plant_noise, axis=0)
        assert first_fault(watch, shuffled) == (-1, [])


def test_a_channel_is_believed_again_after_it_has_changed_for_a_second() -> None:
    """Fails when a channel is believed at its first change, or never again."""
    watch, frames = learned(), resting(600, SEED + 7)
    frames[10:40, ANGLE_3] = frames[9, ANGLE_3]
    faults = [watch.check(counts) is not None for counts in frames]
    believed = len(faults) - 1 - faults[::-1].index(True)
    assert believed == pytest.approx(39 + 200, abs=3)


def test_an_open_force_sensor_is_not_stuck() -> None:
    """Fails when a pad without load, which reads 0 counts, is called stuck."""
    frames = resting(3000, SEED + 8)
    frames[:, HAND.sensors.force_channel] = 0
    assert first_fault(ChannelWatch(HAND), frames) == (-1, [])


def channels(watch: ChannelWatch) -> Health:
    health = DriverHealth(HAND, 0.0)
    health.frame(Frame(1, 0, 5.0, Status(0), np.zeros(HAND.channel_count, np.uint16), 0), [], 0.0, watch)
    return next(s for s in health.statuses(LinkState(up=True, counters=LinkCounters(1)), 0.0) if s.name == "channels")


def test_the_measurement_is_nan_and_the_line_names_joint_channel_evidence_and_check() -> None:
    """Fails when a stuck channel gives a value, or its line lacks the joint, the channel, the run or what to check."""
    watch, frames = learned(), resting(60, SEED + 9)
    frames[5:, ANGLE_3] = frames[4, ANGLE_3]
    converter = Converter(HAND, 0.0)
    for counts in frames:
        measured = converter.convert(Frame(0, 0, 5.0, Status(0), counts, 0), watch.check(counts))
    assert np.flatnonzero(np.isnan(measured.position)).tolist() == [3]
    assert np.isfinite(measured.pressure).all()
    assert measured.at_rail == ()
    said = channels(watch)
    assert said.level == Level.ERROR
    for part in (HAND.joints[3], f"channel {ANGLE_3}", "55 equal readings", "check the sensor, its cable"):
        assert part in said.message


@pytest.mark.parametrize(
    ("supply_v", "measures"), [(4.1, True), (5.9, True), (6.1, False), (6.5, False), (3.9, False), (math.nan, False)]
)
def test_nothing_is_measured_outside_the_supply_of_the_sensors(supply_v: float, measures: bool) -> None:
    """Fails when a supply that is too low, too high or not a number gives angles, or health and values disagree."""
    counts = resting(1)[0]
    measured = Converter(HAND, 0.0).convert(Frame(0, 0, supply_v, Status(0), counts, 0))
    assert np.isfinite(measured.position).all() == measures
    assert np.isnan(measured.force).all() != measures
    health = DriverHealth(HAND, 0.0)
    health.frame(Frame(1, 0, supply_v, Status(0), counts, 0), [], 0.0)
    said = next(s for s in health.statuses(LinkState(up=True), 0.0) if s.name == "supply")
    assert (said.level == Level.ERROR) != measures
