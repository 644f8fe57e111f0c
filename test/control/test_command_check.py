"""Commands from outside: every refusal is one line that names topic, joint, value and range."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hand_control.command_check import CommandError, JointCommand, Trajectory, check_joint_command, check_trajectory
from hand_model.description import load_hand

HAND = load_hand(Path(__file__).resolve().parents[2] / "config" / "hand.yaml")
NOW = 50_000_000_000
NAN, INF = float("nan"), float("inf")
A, B = "index_distal", "thumb_opposition"
Point = tuple[float, list[float], list[float]]
anything = st.floats(allow_nan=True, allow_infinity=True)


def stamped(age_s: float) -> int:
    return NOW - round(age_s * 1e9)


def command(
    names: list[str], position: list[float], effort: list[float] | None = None, stamp_ns: int = 0
) -> JointCommand:
    return check_joint_command(HAND, names, position, effort or [], stamp_ns, NOW)


def trajectory(names: list[str], points: list[Point], stamp_ns: int = 0) -> Trajectory:
    return check_trajectory(HAND, names, points, stamp_ns, NOW)


def refusal(check: Callable[[], object]) -> str:
    with pytest.raises(CommandError) as error:
        check()
    line = str(error.value)
    assert line and "\n" not in line
    return line


@pytest.mark.parametrize(
    ("names", "position", "effort", "age_s", "said"),
    [
        ([], [], [], 0, ["no joint is named", "thumb_opposition"]),
        (["index"], [0.1], [], 0, ["unknown joint 'index'", "index_distal"]),
        (["x\ny"], [0.1], [], 0, ["unknown joint", r"x\ny"]),
        ([A, A], [0.1, 0.1], [], 0, [A, "twice"]),
        ([A, B], [0.1], [], 0, ["1 positions", "2 joints"]),
        ([A], [], [], 0, ["0 positions", "1 joints"]),
        ([A, B], [0.1, 0.1], [0.1], 0, ["1 efforts", "2 joints"]),
        ([B, A], [0.1, NAN], [], 0, [A, "nan", "-10 to 100 degrees"]),
        ([A], [INF], [], 0, [A, "inf", "-10 to 100 degrees"]),
        ([A], [-INF], [], 0, [A, "-inf", "-10 to 100 degrees"]),
        ([A], [2.1], [], 0, [A, "2.1 rad", "-0.1745 to 1.7453 rad"]),
        ([A], [-0.18], [], 0, [A, "-0.18 rad", "-0.1745 to 1.7453 rad"]),
        ([B, A], [0.1, 0.1], [0.1, INF], 0, [A, "inf N m", "0 to 0.6 N m"]),
        ([A], [0.1], [-0.01], 0, [A, "-0.01 N m", "0 to 0.6 N m"]),
        ([A], [0.1], [0.7], 0, [A, "0.7 N m", "0 to 0.6 N m"]),
        ([A], [0.1], [], 2.0, ["2.000 s old", "0.5 s"]),
        ([A], [0.1], [], 0.501, ["0.501 s old", "0.5 s"]),
        ([A], [0.1], [], -0.101, ["0.101 s in the future", "0.1 s"]),
    ],
)
def test_joint_command_is_refused(
    names: list[str], position: list[float], effort: list[float], age_s: float, said: list[str]
) -> None:
    """Fails with a check that lets one of these through, or a line without the place, the value or the range."""
    line = refusal(lambda: command(names, position, effort, stamped(age_s)))
    for part in ["joint_commands", *said]:
        assert part in line


@pytest.mark.parametrize(
    ("names", "points", "age_s", "said"),
    [
        ([A], [], 0, ["no points", "1 to 5000"]),
        ([A], [(1.0 + k, [0.1], []) for k in range(5001)], 0, ["5001 points", "1 to 5000"]),
        ([A], [(1.0, [0.1], []), (1.0 + 1e-10, [0.2], [])], 0, ["1, 1 s", "ascend"]),
        ([], [(1.0, [], [])], 0, ["no joint is named"]),
        (["thumb"], [(1.0, [0.1], [])], 0, ["unknown joint 'thumb'"]),
        ([A, A], [(1.0, [0.1, 0.1], [])], 0, [A, "twice"]),
        ([A], [(1.0, [0.1], []), (1.0, [0.2], [])], 0, ["1, 1 s", "ascend"]),
        ([A], [(2.0, [0.1], []), (1.0, [0.2], [])], 0, ["2, 1 s", "ascend"]),
        ([A], [(-0.1, [0.1], [])], 0, ["-0.1 s", "0 to 3600 s"]),
        ([A], [(3600.1, [0.1], [])], 0, ["3600.1 s", "0 to 3600 s"]),
        ([A], [(NAN, [0.1], [])], 0, ["nan s", "0 to 3600 s"]),
        ([A], [(INF, [0.1], [])], 0, ["inf s", "0 to 3600 s"]),
        ([A, B], [(1.0, [0.1, 0.1], []), (2.0, [0.1], [])], 0, ["1 positions", "2 joints"]),
        ([A], [(1.0, [0.1], []), (2.0, [NAN], [])], 0, [A, "nan", "-10 to 100 degrees"]),
        ([B, A], [(1.0, [0.1, 3.0], [])], 0, [A, "3 rad", "-0.1745 to 1.7453 rad"]),
        ([A, B], [(1.0, [0.1, 0.1], [0.0])], 0, ["1 velocities", "2 joints"]),
        ([A], [(1.0, [0.1], [NAN])], 0, [A, "velocity is nan rad/s", "-100 to 100"]),
        ([B, A], [(1.0, [0.1, 0.1], [0.0, 1e308])], 0, [A, "velocity is 1e+308 rad/s", "-100 to 100"]),
        ([A], [(1.0, [0.1], [0.0]), (2.0, [0.2], [])], 0, ["velocities", "all points or at none"]),
        ([A], [(1.0, [0.1], [])], 0.6, ["0.600 s old", "0.5 s"]),
        ([A], [(1.0, [0.1], [])], -10.1, ["10.100 s in the future", "10 s"]),
    ],
)
def test_trajectory_is_refused(names: list[str], points: list[Point], age_s: float, said: list[str]) -> None:
    """Fails with a check that lets one of these through, or a line without the place, the value or the range."""
    line = refusal(lambda: trajectory(names, points, stamped(age_s)))
    for part in ["joint_trajectory", *said]:
        assert part in line


def test_joint_command_in_the_hands_order() -> None:
    """Fails with a wrong index of a partial list in the sender's order, or a changed value."""
    checked = command([A, B], [0.3, 0.5], [NAN, 0.2])
    assert [HAND.joints[k] for k in checked.index] == [A, B]
    assert checked.index.dtype == np.int64
    np.testing.assert_array_equal(checked.position_rad, [0.3, 0.5])
    np.testing.assert_array_equal(checked.max_torque_nm, [NAN, 0.2])


def test_empty_effort_means_the_configured_limit() -> None:
    """Fails with an empty effort that becomes a torque of 0."""
    assert np.isnan(command([A, B], [0.3, 0.5]).max_torque_nm).all()


def test_limits_themselves_are_allowed() -> None:
    """Fails with limits that exclude their ends."""
    low, high, most = HAND.limits.low_rad, HAND.limits.high_rad, HAND.limits.max_torque_nm
    for end in (low, high):
        np.testing.assert_array_equal(command(list(HAND.joints), list(end), list(most)).position_rad, end)
    assert command([A], [0.1], [0.0]).max_torque_nm[0] == 0.0
    with pytest.raises(CommandError):
        command([A], [np.nextafter(high[0], 9.0)])
    with pytest.raises(CommandError):
        command([A], [np.nextafter(low[0], -9.0)])


@pytest.mark.parametrize("age_s", [0.499, 0.0, -0.099])
def test_fresh_stamps_are_taken(age_s: float) -> None:
    """Fails with a narrower window for stamps, or a stamp of 0 that is an age since 1970."""
    command([A], [0.1], stamp_ns=stamped(age_s))
    command([A], [0.1], stamp_ns=0)


@pytest.mark.parametrize(("age_s", "starts_s"), [(-9.9, 9.9), (-0.5, 0.5), (0.0, 0.0), (0.4, 0.0)])
def test_trajectory_starts_at_its_stamp(age_s: float, starts_s: float) -> None:
    """Fails with a trajectory that ignores a stamp ahead, or that starts before it has arrived."""
    assert trajectory([A], [(1.0, [0.1], [])], stamped(age_s)).start_ns == NOW + round(starts_s * 1e9)
    assert trajectory([A], [(1.0, [0.1], [])], 0).start_ns == NOW


def test_trajectory_arrays() -> None:
    """Fails with points out of order or velocities that are made up."""
    checked = trajectory([B, A], [(0.0, [0.1, 0.2], [0.0, 1.0]), (2.0, [0.3, 0.4], [0.5, 0.0])])
    np.testing.assert_array_equal(checked.times_s, [0.0, 2.0])
    np.testing.assert_array_equal(checked.position_rad, [[0.1, 0.2], [0.3, 0.4]])
    assert checked.velocity_rad_s is not None
    np.testing.assert_array_equal(checked.velocity_rad_s, [[0.0, 1.0], [0.5, 0.0]])
    assert trajectory([A], [(1.0, [0.1], [])]).velocity_rad_s is None


def test_checked_command_keeps_its_own_values() -> None:
    """Fails with arrays that share memory with the message: it may be reused by the middleware."""
    position = array("d", [0.3])
    checked = check_joint_command(HAND, [A], position, array("d"), 0, NOW)
    position[0] = 9.0
    assert checked.position_rad[0] == 0.3


@settings(max_examples=300, deadline=None)
@given(
    names=st.lists(st.sampled_from([*HAND.joints, "", "elbow"]), max_size=4),
    position=st.lists(anything | st.floats(-0.1, 1.7), max_size=4),
    effort=st.lists(anything | st.floats(0.0, 0.6), max_size=4),
)
def test_whatever_passes_is_safe(names: list[str], position: list[float], effort: list[float]) -> None:
    """Fails with any message that passes with a value out of range, or that fails with anything but CommandError."""
    try:
        checked = command(names, position, effort)
    except CommandError as error:
        assert "\n" not in str(error)
        return
    low, high = HAND.limits.low_rad[checked.index], HAND.limits.high_rad[checked.index]
    assert len(set(checked.index.tolist())) == len(names) == len(checked.position_rad) == len(checked.max_torque_nm)
    assert ((low <= checked.position_rad) & (checked.position_rad <= high)).all()
    torque = checked.max_torque_nm[~np.isnan(checked.max_torque_nm)]
    assert ((torque >= 0.0) & (torque <= 0.6)).all()


@settings(max_examples=300, deadline=None)
@given(
    times=st.lists(anything | st.floats(0.0, 10.0), min_size=1, max_size=3),
    angle=anything | st.floats(-0.1, 1.7),
    velocity=st.none() | anything,
)
def test_whatever_trajectory_passes_is_safe(times: list[float], angle: float, velocity: float | None) -> None:
    """Fails with a trajectory that passes with a value out of range, or fails with anything but CommandError."""
    speeds = [] if velocity is None else [velocity]
    try:
        checked = trajectory([A], [(time, [angle], speeds) for time in times])
    except CommandError as error:
        assert "\n" not in str(error)
        return
    assert np.isfinite(checked.times_s).all() and (np.diff(checked.times_s) > 0.0).all()
    assert checked.times_s[0] >= 0.0 and checked.times_s[-1] <= 3600.0
    assert ((HAND.limits.low_rad[0] <= checked.position_rad) & (checked.position_rad <= HAND.limits.high_rad[0])).all()
    assert checked.velocity_rad_s is None or np.isfinite(checked.velocity_rad_s).all()
