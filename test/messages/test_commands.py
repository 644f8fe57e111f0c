"""Joint commands and trajectories from bytes, against rosbags' encoding of the same messages; their bounds."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from hand_messages.bounds import MAX_BYTES, MAX_NAMES, BoundError, Budget, listed, shown
from hand_messages.cdr import Layout, LayoutError
from hand_messages.commands import LISTS, MAX_POINTS, TRAJECTORY, read_joint_command, read_trajectory
from hand_messages.layouts import JOINT_STATE, VALVE_COMMAND

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPES = STORE.types
NUMBERS = st.floats(width=64)
NAMES = st.lists(st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=9), max_size=6)


def _header(sec: int, nanosec: int, frame: str) -> Any:
    return TYPES["std_msgs/msg/Header"](TYPES["builtin_interfaces/msg/Time"](sec, nanosec), frame)


def trajectory(names: list[str], points: list[tuple[tuple[list[float], ...], int, int]], frame: str = "") -> bytes:
    """Bytes of a trajectory; points of (the four lists, seconds, nanoseconds)."""
    kind, duration = TYPES["trajectory_msgs/msg/JointTrajectoryPoint"], TYPES["builtin_interfaces/msg/Duration"]
    made = [kind(*(np.array(values, float) for values in lists), duration(sec, nano)) for lists, sec, nano in points]
    message = TYPES[TRAJECTORY](_header(7, 8, frame), names, made)
    return bytes(STORE.serialize_cdr(message, TRAJECTORY))


@st.composite
def alike(draw: st.DrawFn) -> tuple[list[str], list[tuple[tuple[list[float], ...], int, int]], str]:
    """Names, points with lists of the same lengths, and a frame that moves the alignment of the points."""
    lengths = [draw(st.integers(0, 4)) for _ in LISTS]
    lists = st.tuples(*(st.lists(NUMBERS, min_size=n, max_size=n) for n in lengths))
    times = st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1)
    return draw(NAMES), draw(st.lists(st.tuples(lists, *times), max_size=5)), draw(st.text("abc", max_size=8))


@given(alike())
def test_a_trajectory_is_read_as_it_was_written(case: tuple[Any, Any, str]) -> None:
    """Fails when a list, a time or an alignment is read from another place than rosbags writes it."""
    names, points, frame = case
    got = read_trajectory(trajectory(names, points, frame), 11)
    assert (got.header.stamp, got.header.frame_id, list(got.joint_names)) == ((7, 8), frame, names)
    assert len(got.points) == len(points)
    for point, (lists, sec, nano) in zip(got.points, points, strict=True):
        assert point.time_from_start == (sec, nano)
        for values, expected in zip(point[:4], lists, strict=True):
            np.testing.assert_array_equal(values, expected)


@given(NAMES, st.tuples(*(st.lists(NUMBERS, max_size=5) for _ in range(3))), st.text("abc", max_size=8))
def test_a_joint_command_is_read_as_it_was_written(names: list[str], lists: Any, frame: str) -> None:
    """Fails when a list of joint_commands is read from another place than rosbags writes it."""
    message = TYPES[JOINT_STATE.type](_header(1, 2, frame), names, *(np.array(values, float) for values in lists))
    got = read_joint_command(bytes(STORE.serialize_cdr(message, JOINT_STATE.type)))
    assert (got.header.stamp, got.header.frame_id, list(got.name)) == ((1, 2), frame, names)
    for values, expected in zip(got[2:], lists, strict=True):
        np.testing.assert_array_equal(values, expected)


@given(st.binary(max_size=400), st.integers(0, 300), st.data())
def test_mutated_messages_are_read_or_refused_in_one_line(noise: bytes, at: int, data: st.DataObject) -> None:
    """Fails when damaged bytes raise anything but the two errors of one line."""
    good = trajectory(["a", "b"], [(([0.1, 0.2], [0.0, 0.0], [], []), k, 0) for k in range(4)])
    cut = data.draw(st.integers(0, len(good)))
    for raw in (
        good[:at] + noise,
        good[:cut],
        good[:at] + noise + good[at + len(noise) :],
        b"\x00\x01\x00\x00" + noise,
    ):
        for read in (read_joint_command, lambda raw: read_trajectory(raw, 11)):
            try:
                read(raw)
            except (BoundError, LayoutError) as error:
                assert "\n" not in str(error)


def test_points_that_differ_are_refused_and_named() -> None:
    """Fails when lists of unequal length are read from wrong places, or the line does not name the point."""
    full: tuple[list[float], ...] = ([0.1, 0.2], [0.0, 0.0], [], [])
    short: tuple[list[float], ...] = ([0.1, 0.2], [], [], [])
    with pytest.raises(LayoutError, match=r"the lists of point 1 differ in length.*see its velocities"):
        read_trajectory(trajectory(["a", "b"], [(full, 0, 0), (short, 1, 0), (full, 2, 0), (full, 3, 0)]), 11)


def long_list(count: int, spec: str) -> bytes:
    """A message that says it has `count` names and holds so many; every list after it is empty."""
    head = struct.pack("<iII", 0, 0, 1) + b"\x00" * 4
    lifetime = struct.pack("<iI", 0, 100_000_000) if spec == "valve_command" else b""
    return b"\x00\x01\x00\x00" + head + lifetime + struct.pack("<I", count) + b"\x01\x00\x00\x00j\x00\x00\x00" * count


READERS: dict[str, Callable[[bytes], object]] = {
    "joint_commands": read_joint_command,
    "joint_trajectory": lambda raw: read_trajectory(raw, 11),
    "valve_command": lambda raw: Layout.like(VALVE_COMMAND, raw, MAX_NAMES),
}


@pytest.mark.parametrize("topic", READERS)
@pytest.mark.parametrize("count", [MAX_NAMES + 1, 8000, 150_000, 1_000_000])
def test_a_million_names_cost_nothing(topic: str, count: int) -> None:
    """Fails when names are decoded before they are counted: the best of five refusals may take 1 ms."""
    raw, best = long_list(count, topic), 1.0
    for _ in range(5):
        begun = time.perf_counter()
        with pytest.raises((BoundError, LayoutError), match=r"at most \d+ are allowed"):
            READERS[topic](raw)
        best = min(best, time.perf_counter() - begun)
    assert best < 1e-3


def test_points_are_counted_before_they_are_read() -> None:
    """Fails when a trajectory of more than MAX_POINTS points, or one beyond the bytes of the hand, is decoded."""
    most = trajectory([], [(([], [], [], []), k, 0) for k in range(MAX_POINTS)])
    assert len(read_trajectory(most, 11).points) == MAX_POINTS
    more = trajectory([], [(([], [], [], []), k, 0) for k in range(MAX_POINTS + 1)])
    with pytest.raises(LayoutError, match="points has 5001 entries; at most 5000 are allowed"):
        read_trajectory(more, 11)
    with pytest.raises(BoundError, match="at most"):
        read_trajectory(b"\x00\x01\x00\x00" + bytes(3_000_000), 11)


def test_a_list_longer_than_the_message_is_not_begun() -> None:
    """Fails when a length of 4 * 10^9 is believed: nothing of that size may be made."""
    raw = b"\x00\x01\x00\x00" + struct.pack("<iII", 0, 0, 1) + b"\x00" * 4 + struct.pack("<II", 0, 0xFFFFFFFF)
    for read in READERS.values():
        with pytest.raises((BoundError, LayoutError)):
            read(raw)


def test_the_budget_passes_its_rate_and_a_burst() -> None:
    """Fails when more than the rate passes over a second, a burst is cut, or a flood is not reported and forgotten."""
    budget = Budget(rate_hz=100.0, burst=10)
    assert [budget.take(0.0) for _ in range(12)] == [True] * 10 + [False] * 2
    passed = sum(budget.take(k / 5000.0) for k in range(1, 5001))
    assert 99 <= passed <= 101
    assert "more than 100 messages a second" in budget.problem(1.0)
    assert budget.dropped == 2 + 5000 - passed
    assert budget.problem(7.0) == ""
    assert budget.take(7.0)


def test_the_budget_survives_a_clock_that_goes_back() -> None:
    """Fails when an earlier time opens or closes the budget for good."""
    budget = Budget(rate_hz=10.0, burst=1)
    assert budget.take(100.0)
    assert not budget.take(50.0)
    assert budget.take(50.2)


def test_what_is_shown_is_short() -> None:
    """Fails when a long name or list fills the line of an error."""
    assert shown("index_proximal") == "'index_proximal'"
    assert len(shown("x" * MAX_BYTES)) < 80
    assert listed(["a", "b"]) == "a, b"
    assert len(listed(["x" * 5000] * 256)) < 1500
    assert listed([str(k) for k in range(20)]).endswith("15 and 4 more")
    assert listed(["a\nb", "c"]) == r"'a\nb', c"
