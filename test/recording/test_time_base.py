"""The rules by which signals are laid on one time base."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hand_recording.columns import TopicData
from hand_recording.interpolation import interpolate
from hand_recording.loader import Recording, RecordingError, load_recording
from hand_recording.time_base import published_on_stamp_clock

MS = 1_000_000
NAN = np.nan


def _topic(stamps_ms: list[int], publish_ms: list[int] | None = None, **fields: list[list[float]]) -> TopicData:
    stamps = np.array(stamps_ms, np.int64) * MS
    publish = stamps if publish_ms is None else np.rint(np.array(publish_ms, np.float64) * MS).astype(np.int64)
    columns = {name: np.array(values, np.float64) for name, values in fields.items()}
    return TopicData(
        name="t",
        type="T",
        names=("a", "b"),
        stamp_ns=stamps,
        log_ns=publish,
        publish_ns=publish,
        fields=columns,
        malformed=0,
    )


def _recording(**topics: TopicData) -> Recording:
    return Recording(Path("r"), "/hand", topics)


def _states(stamps_ms: list[int], position: list[list[float]]) -> TopicData:
    return _topic(stamps_ms, position=position, velocity=position, effort=position)


def _at(*times_ms: float) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.array([round(time * MS) for time in times_ms], np.int64)


def test_measurements_are_interpolated_between_samples_only() -> None:
    """Breaks when a value is invented before the first sample, after the last or inside a long gap."""
    states = _states([10, 20, 200], [[1.0, 0.0], [3.0, NAN], [5.0, 1.0]])
    base = _recording(joint_states=states).on_time_base(stamps_ns=_at(9, 10, 15, 20, 60, 200, 201))
    np.testing.assert_array_equal(base.position[:, 0], [NAN, 1, 2, 3, NAN, 5, NAN])
    np.testing.assert_array_equal(base.position[:, 1], [NAN, 0, NAN, NAN, NAN, 1, NAN])
    wide = _recording(joint_states=states).on_time_base(stamps_ns=_at(110), max_gap_s=1.0)
    assert wide.position[0, 0] == 4.0


@given(st.data())
def test_interpolation_agrees_with_numpy(data: st.DataObject) -> None:
    """Breaks when a weight or a neighbour is wrong, or a sample's own stamp does not give that sample."""
    stamps = np.array(sorted(data.draw(st.sets(st.integers(0, 10**12), min_size=1, max_size=20))), np.int64)
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    values = rng.normal(size=(len(stamps), 2))
    times = np.sort(np.concatenate([stamps, rng.integers(stamps[0], stamps[-1] + 1, 30)]))
    result = interpolate(times, stamps, values, 10**12)
    for column in range(2):
        np.testing.assert_allclose(result[:, column], np.interp(times, stamps, values[:, column]), atol=1e-9)
    assert (result[np.isin(times, stamps)] == values[np.searchsorted(stamps, times[np.isin(times, stamps)])]).all()


def test_commands_hold_from_their_publication_and_vent_past_their_lifetime() -> None:
    """Breaks when a command acts before it was sent, or for longer than the board obeys it."""
    command = _topic([0, 10], [4, 12], pressure=[[1e5, 2e5], [3e5, 4e5]])
    command.fields["lifetime_ns"] = np.array([100 * MS, 20 * MS])
    recording = _recording(joint_states=_states([0, 50], [[0, 0], [0, 0]]), valve_command=command)
    base = recording.on_time_base(stamps_ns=_at(0, 3.9, 4, 11.9, 12, 32, 32.1))
    np.testing.assert_array_equal(base.valve_command[:, 0], [NAN, NAN, 1e5, 1e5, 3e5, 3e5, 0])


def test_publication_is_moved_onto_a_simulated_clock() -> None:
    """Breaks when wall-clock publish times are compared with simulated stamps."""
    clock = _topic([0, 10, 20], [1000, 1001, 1002])
    command = _topic([0], [1001], pressure=[[7.0, 7.0]])
    command.fields["lifetime_ns"] = np.array([100 * MS])
    recording = _recording(joint_states=_states([0, 20], [[0, 0], [0, 0]]), valve_command=command, clock=clock)
    base = recording.on_time_base(stamps_ns=_at(9, 10, 20))
    np.testing.assert_array_equal(base.valve_command[:, 1], [NAN, 7, 7])


def test_publication_between_two_ticks_of_a_simulated_clock() -> None:
    """Breaks when the tick before is held: ticks of a played recording are 25 ms apart, five frames."""
    clock = _topic([0, 25, 50], [1000, 1025, 1050])
    command = _topic([0, 0], [1010, 1060], pressure=[[7.0, 7.0], [8.0, 8.0]])
    command.fields["lifetime_ns"] = np.array([100 * MS] * 2)
    recording = _recording(joint_states=_states([0, 20], [[0, 0], [0, 0]]), valve_command=command, clock=clock)
    np.testing.assert_array_equal(published_on_stamp_clock(recording.topics), np.array([10, 50]) * MS)


@pytest.mark.parametrize("rate", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_played_recording_keeps_the_times_of_its_commands(rate: float, seed: int) -> None:
    """Breaks when a recording that was played without /clock and recorded again loses the delay of its commands."""
    rng = np.random.default_rng(seed)
    print("seed", seed)
    stamps = 1_700_000_000_000 + np.arange(0, 5000, 5)
    sent = stamps + 2.6
    busy = np.where(rng.random(len(stamps)) < 0.3, rng.exponential(20.0, len(stamps)), 0.0)

    def played(times_ms: Any, delay: Any) -> list[float]:
        return list(1_750_000_000_000 + (times_ms - stamps[0]) / rate + delay)

    states = _topic(stamps.tolist(), played(stamps + 1.0, busy), position=[[0.0, 0.0]] * 1000)  # type: ignore[arg-type]
    command = _topic(stamps.tolist(), played(sent, 0.0), pressure=[[7.0, 7.0]] * 1000)  # type: ignore[arg-type]
    moved = published_on_stamp_clock({"joint_states": states, "valve_command": command})
    delay_ms = (moved - stamps * MS) / MS
    assert np.abs(delay_ms - 1.6).max() < 1.0


def test_without_frames_the_stamps_stand_for_foreign_publish_times() -> None:
    """Breaks when commands of another clock are used at the times of that clock."""
    command = _topic([0, 10], [10**9, 10**9 + 10], pressure=[[7.0, 7.0]] * 2)
    np.testing.assert_array_equal(published_on_stamp_clock({"valve_command": command}), np.array([0, 10]) * MS)


def test_reference_holds_until_it_is_stale() -> None:
    """Breaks when a reference is interpolated, or outlives its controller."""
    state = _topic([10, 20], reference=[[1.0, 2.0], [3.0, 4.0]])
    recording = _recording(joint_states=_states([0, 300], [[0, 0], [0, 0]]), controller_state=state)
    base = recording.on_time_base(stamps_ns=_at(9, 19, 20, 120, 121))
    np.testing.assert_array_equal(base.reference[:, 1], [NAN, 2, 4, 4, NAN])


def test_columns_follow_the_joints_asked_for() -> None:
    """Breaks when joints are taken by position instead of by name, or an absent one gets another's numbers."""
    recording = _recording(joint_states=_states([0, 1], [[1, 2], [1, 2]]))
    base = recording.on_time_base(joints=["b", "c", "a"])
    np.testing.assert_array_equal(base.position, [[2, NAN, 1]] * 2)
    assert base.force.shape == (2, 0)
    assert np.isnan(base.pressure).all()
    with pytest.raises(RecordingError, match="none of the joints x, y"):
        recording.on_time_base(joints=["x", "y"])


def test_repeated_and_disordered_stamps() -> None:
    """Breaks when a stamp that comes twice or late gives a division by zero or the older sample."""
    base = _recording(joint_states=_states([20, 10, 20], [[1, 1], [2, 2], [3, 3]])).on_time_base()
    assert (base.time_ns // MS).tolist() == [10, 20]
    np.testing.assert_array_equal(base.position[:, 0], [2, 3])


def test_a_period_spans_the_recording(make_bag: Callable[..., Path]) -> None:
    """Breaks when a whole recording is not laid on an even base, or sites and joints are mixed up."""
    recording = load_recording(make_bag(ticks=41))
    base = recording.on_time_base(period_s=0.02)
    np.testing.assert_allclose(base.time_s, np.arange(11) * 0.02)
    assert base.joints == base.sites == recording["joint_states"].names
    assert base.position.tobytes() == recording["joint_states"]["position"][::4].tobytes()
    assert base.force.tobytes() == recording["contact_forces"]["force"][::4].tobytes()
    for bad in (0.0, -1.0, NAN):
        with pytest.raises(RecordingError, match="period_s"):
            recording.on_time_base(period_s=bad)
    with pytest.raises(RecordingError, match="rising"):
        recording.on_time_base(stamps_ns=np.array([3, 2]))
