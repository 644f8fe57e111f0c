"""Recorders that keep some frames only, stamps that scatter, and lost frames: no false findings, and what is there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_diagnosis.diagnosis import diagnose
from hand_model.description import Hand
from hand_recording.columns import TopicData
from hand_recording.hand_signals import hand_signals
from hand_recording.loader import Recording, load_recording
from hand_recording.replay import record_offline
from test.diagnosis.recordings import changed, excitation, off_by_a_little

JOINT = "index_distal"
SEED = 83


@pytest.fixture(scope="module")
def plain(hand: Hand, tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """A recording at 200 Hz, with commands at 200 Hz."""
    return recorded(hand, tmp_path_factory.mktemp("plain"))


def recorded(truth: Hand, folder: Path) -> Recording:
    commands = excitation(np.random.default_rng(SEED), 20.0, len(truth.joints))
    for _ in record_offline(truth, commands, folder / "run.mcap", SEED):
        pass
    return load_recording(folder / "run.mcap")


def with_frames(recording: Recording, change: Callable[[TopicData], TopicData]) -> Recording:
    """The recording with its readings changed; commands stay."""
    topics = {name: topic if name == "valve_command" else change(topic) for name, topic in recording.topics.items()}
    return replace(recording, topics=topics)


def kept(topic: TopicData, rows: np.ndarray | slice) -> TopicData:
    """A topic with some of its messages."""
    fields = {name: values[rows] for name, values in topic.fields.items()}
    stamps = {name: getattr(topic, name)[rows] for name in ("stamp_ns", "log_ns", "publish_ns")}
    return replace(topic, fields=fields, **stamps)


def excess_floors(result, stage: str) -> float:  # type: ignore[no-untyped-def]
    """Error beyond the noise of a signal, in practical floors."""
    found = next(r for r in result.joints[0].results if r.name == stage)
    return float(found.excess_after / found.floor)


@pytest.mark.parametrize("every", [8, 4, 3])
def test_a_slow_recorder_gives_no_finding(every: int, plain: Recording, hand: Hand) -> None:
    """Fails when set-points act at the recorded samples instead of at their own times: the pressure is off then."""
    print("seed", SEED)
    model = off_by_a_little(hand, np.random.default_rng(SEED))
    signals = hand_signals(with_frames(plain, lambda topic: kept(topic, slice(None, None, every))), model)
    assert signals.period_s == pytest.approx(0.005 * every)
    assert signals.between_pa is not None
    assert len(signals.between_pa) == every * (signals.samples - 1) + 1
    assert any("kept some frames only" in note for note in signals.notes)
    result = diagnose([signals], model, tolerance=0.05, seed=0, joints=[JOINT], sensor_curve=True)
    assert result.verdict == "agrees", result.findings
    assert excess_floors(result, "pressure") < 0.5


def test_a_slow_recorder_shows_an_effect(hand: Hand, tmp_path: Path) -> None:
    """Fails when friction is not found, or something else is, in a recording at 25 Hz."""
    print("seed", SEED)
    rubbing = recorded(changed(hand, JOINT, coulomb_friction__torque_nm=0.015), tmp_path)
    signals = hand_signals(with_frames(rubbing, lambda topic: kept(topic, slice(None, None, 8))), hand)
    without = [
        "creep",
        "gas_compression",
        "joint_coupling",
        "thermal_drift",
        "ageing",
        "contact",
        "end_stop",
        "gravity",
    ]
    result = diagnose([signals], hand, tolerance=0.05, seed=0, joints=[JOINT], without=without, sensor_curve=True)
    assert [finding.effect for finding in result.findings] == ["coulomb_friction"], result.findings


def test_scattered_stamps_and_lost_frames_are_not_an_effect(plain: Recording, hand: Hand) -> None:
    """Fails when stamps off by up to 3 ms with 5 % of the frames lost are taken for physics, or are not reported."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    frames = len(plain["joint_states"])
    away, there = np.rint(rng.uniform(-3e6, 3e6, frames)).astype(np.int64), rng.random(frames) > 0.05

    def disturbed(topic: TopicData) -> TopicData:
        moved = replace(topic, stamp_ns=topic.stamp_ns + away)
        return kept(moved, np.flatnonzero(there)[np.flatnonzero(there) % 2 == 0])

    model = off_by_a_little(hand, rng)
    signals = hand_signals(with_frames(plain, disturbed), model)
    assert any("scatter by 1.7 ms" in note for note in signals.notes), signals.notes
    assert signals.dropped == pytest.approx(0.05, abs=0.02)
    result = diagnose([signals], model, tolerance=0.05, seed=0, joints=[JOINT], sensor_curve=True)
    assert {finding.effect for finding in result.findings} <= {"dropped_frames"}, result.findings
    assert not result.remainder
    assert excess_floors(result, "pressure") < 0.5
