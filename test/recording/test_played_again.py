"""A recording that `ros2 bag play` published and another recorder wrote: the replay of its commands, and its checks."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from hand_diagnosis.problem import check
from hand_model.description import load_hand
from hand_recording.bag_writer import Topic, open_bag
from hand_recording.hand_signals import hand_signals
from hand_recording.loader import RecordingError, load_recording
from hand_recording.reading import iter_raw
from hand_recording.replay import record_offline, replay_recording
from hand_tool.replay_difference import difference_deg

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
DAY_NS = 86_400_000_000_000


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six seconds of steps on every joint."""
    path = tmp_path_factory.mktemp("played") / "original.mcap"
    steps = np.repeat([0.0, 3e5, 1e5, 4e5, 0.0, 2e5], 200)
    for _ in record_offline(HAND, np.repeat(steps[:, None], len(HAND.joints), axis=1), path, seed=1):
        pass
    return path


def played(original: Path, out: Path, keep: float = 1.0) -> Path:
    """The recording as another recorder writes it a day later, without /clock. keep: share of frames received."""
    bag = open_bag(out)
    for name, kind in {message.topic.name: message.topic.type for message in iter_raw(original)}.items():
        bag.add_topic(Topic.of(name, kind))
    rng, lost = np.random.default_rng(3), set[int]()
    for message in iter_raw(original):
        if not message.topic.name.endswith("valve_command"):
            if rng.random() > keep:
                lost.add(message.log_ns)
            if message.log_ns in lost:
                continue
        sent_ns = message.publish_ns + DAY_NS
        bag.write(message.topic.name, message.raw, sent_ns, sent_ns)
    bag.close()
    return out


def rms(path: Path) -> float:
    recording = load_recording(path)
    return max(difference_deg(recording, replay_recording(recording, HAND)).values())


def test_the_replay_of_a_played_recording_is_that_of_the_original(original: Path, tmp_path: Path) -> None:
    """Fails when the commands are taken at the times of the playing: then 2 frames are compared, or none."""
    again = played(original, tmp_path / "again.mcap")
    recording = load_recording(again)
    assert len(replay_recording(recording, HAND).states) == len(recording["joint_states"])
    assert rms(again) == pytest.approx(rms(original), abs=0.02)


def test_a_replay_of_a_few_frames_is_refused(original: Path) -> None:
    """Fails when an error is reported for a replay that covers only a small part of the recording."""
    recording = load_recording(original)
    command = recording.topics["valve_command"]
    pressures = recording.topics["pressures"]
    late = dataclasses.replace(
        command,
        publish_ns=command.publish_ns + 5_900_000_000,
        stamp_ns=command.stamp_ns + 5_900_000_000,
    )
    driven = dataclasses.replace(pressures, fields={"pressure": np.full_like(pressures["pressure"], 1e5)})
    shifted = dataclasses.replace(recording, topics=recording.topics | {"valve_command": late, "pressures": driven})
    with pytest.raises(RecordingError, match=r"known at \d+ of 1200 frames only; at least 10% are needed"):
        replay_recording(shifted, HAND)


def test_lost_frames_and_late_commands_are_named(original: Path, tmp_path: Path) -> None:
    """Fails when the data check passes over a recording of a starved host, or names a sound one."""
    sound = check(hand_signals(load_recording(original), HAND), HAND)
    assert not any("missing" in line or "later than" in line for line in (*sound.lines, *sound.signals.notes))
    lossy = check(hand_signals(load_recording(played(original, tmp_path / "lossy.mcap", keep=0.8)), HAND), HAND)
    assert any("% of its frames are missing; the host or the link was too slow" in line for line in lossy.lines)
    recording = load_recording(original)
    command = recording.topics["valve_command"]
    delayed = dataclasses.replace(command, publish_ns=command.publish_ns + 85_000_000)
    late = dataclasses.replace(recording, topics=recording.topics | {"valve_command": delayed})
    assert any("the controller's host was too busy" in note for note in hand_signals(late, HAND).notes)
