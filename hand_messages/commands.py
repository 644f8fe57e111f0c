"""Joint commands and trajectories from their bytes, with bounds that are checked before anything is made of them.

rclpy converts a message before a node sees it: a trajectory of 5,000 points takes it 0.09 s, and a message of 10^6
names more than a second. Here sizes and counts come first, and the points are read as arrays. The results have the
fields of the ROS messages.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hand_messages.bounds import MAX_BYTES, MAX_NAMES, check_bytes
from hand_messages.cdr_walk import HEADER_SIZE, Cursor, LayoutError
from hand_messages.layouts import JOINT_STATE

TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
MAX_POINTS = 5000
"""Most points of a trajectory; reading and checking more would delay the next frame."""
LISTS = ("positions", "velocities", "accelerations", "effort")
_LEAST_POINT = 24  # bytes: four empty lists and a time


class Stamp(NamedTuple):
    """As builtin_interfaces/Time and Duration: sec [s], nanosec [ns]."""

    sec: int
    nanosec: int


class Header(NamedTuple):
    """As std_msgs/Header."""

    stamp: Stamp
    frame_id: str


class JointCommandMessage(NamedTuple):
    """As sensor_msgs/JointState: position [rad], velocity [rad/s], effort [N m]."""

    header: Header
    name: tuple[str, ...]
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    effort: tuple[float, ...]


class Point(NamedTuple):
    """As trajectory_msgs/JointTrajectoryPoint: [rad], [rad/s], [rad/s^2], [N m]."""

    positions: list[float]
    velocities: list[float]
    accelerations: list[float]
    effort: list[float]
    time_from_start: Stamp


class TrajectoryMessage(NamedTuple):
    """As trajectory_msgs/JointTrajectory."""

    header: Header
    joint_names: tuple[str, ...]
    points: list[Point]


def trajectory_bytes(joints: int) -> int:
    """Largest message [bytes] of a trajectory of MAX_POINTS points with every list for this many joints."""
    return MAX_BYTES + MAX_POINTS * (len(LISTS) * (8 + 8 * joints) + 8)


def read_joint_command(raw: bytes) -> JointCommandMessage:
    """A message of joint_commands. Raises BoundError or LayoutError, one line, where it is too large or broken."""
    check_bytes(len(raw))
    cursor = Cursor(JOINT_STATE.type, raw)
    header, names = _header(cursor), cursor.strings("name", MAX_NAMES)
    position, velocity, effort = (_numbers(cursor, field) for field in ("position", "velocity", "effort"))
    return JointCommandMessage(header, names, position, velocity, effort)


def _header(cursor: Cursor) -> Header:
    stamp = Stamp(*struct.unpack_from("<iI", cursor.raw, cursor.skip(4, 2)))
    return Header(stamp, cursor.string())


def _numbers(cursor: Cursor, field: str) -> tuple[float, ...]:
    count = cursor.entries(field, 8, MAX_NAMES)
    start = cursor.skip(8, count)
    return struct.unpack_from(f"<{count}d", cursor.raw, start) if count else ()


def read_trajectory(raw: bytes, joints: int) -> TrajectoryMessage:
    """A message of joint_trajectory for a hand with this many joints.

    Raises BoundError or LayoutError, one line, where it is too large or broken, or its points are not alike.
    """
    check_bytes(len(raw), trajectory_bytes(joints))
    cursor = Cursor(TRAJECTORY, raw)
    header, names = _header(cursor), cursor.strings("joint_names", MAX_NAMES)
    count = cursor.entries("points", _LEAST_POINT, MAX_POINTS)
    return TrajectoryMessage(header, names, _points(cursor, count) if count else [])


class _PointLayout:
    """Offsets [bytes] in a point whose first byte lies `phase` bytes behind a multiple of 8 (after the header)."""

    def __init__(self, phase: int, lengths: list[int]) -> None:
        at = phase
        self.counts: list[int] = []
        self.data: list[int] = []
        for length in lengths:
            self.counts.append(at - phase)
            at += 4
            if length:
                at += -at % 8
            self.data.append(at - phase)
            at += 8 * length
        self.time = at - phase
        self.size = at + 8 - phase


def _points(cursor: Cursor, count: int) -> list[Point]:
    """All points, read as arrays: they have lists of the same lengths, so that their places are known."""
    first = cursor.skip(4, 0) + -(cursor.position - HEADER_SIZE) % 4
    cursor.position = first
    lengths = []
    for field in LISTS:
        lengths.append(cursor.entries(field, 8, MAX_NAMES))
        cursor.skip(8, lengths[-1])
    layouts = [_PointLayout(phase, lengths) for phase in (0, 4)]
    starts, at = np.empty(count, np.int64), first
    for k in range(count):
        starts[k] = at
        at += layouts[(at - HEADER_SIZE) % 8 // 4].size
    phase = (starts - HEADER_SIZE) % 8 // 4
    _check_alike(cursor, starts, phase, layouts, lengths)

    def column(offsets: list[int]) -> NDArray[np.int64]:
        return starts - HEADER_SIZE + np.array(offsets, np.int64)[phase]

    doubles = np.frombuffer(cursor.raw, "<f8", (len(cursor.raw) - HEADER_SIZE) // 8, HEADER_SIZE)
    lists = [
        doubles[column([layout.data[k] for layout in layouts])[:, None] // 8 + np.arange(length)].tolist()
        for k, length in enumerate(lengths)
    ]
    time = column([layout.time for layout in layouts])[:, None] // 4 + np.arange(2)
    words = np.frombuffer(cursor.raw, "<u4", (len(cursor.raw) - HEADER_SIZE) // 4, HEADER_SIZE)[time]
    sec, nanosec = words[:, 0].astype(np.int32).tolist(), words[:, 1].tolist()
    times = map(Stamp, sec, nanosec)
    return [Point(*row) for row in zip(*lists, times, strict=True)]


def _check_alike(
    cursor: Cursor, starts: NDArray[np.int64], phase: NDArray[np.int64], layouts: list[_PointLayout], lengths: list[int]
) -> None:
    """Raises LayoutError where a point has a list of another length than the first, or the message ends too early."""
    words = np.frombuffer(cursor.raw, "<u4", (len(cursor.raw) - HEADER_SIZE) // 4, HEADER_SIZE)
    ends = starts + np.array([layout.size for layout in layouts])[phase]
    inside = ends <= len(cursor.raw)
    for k, (field, length) in enumerate(zip(LISTS, lengths, strict=True)):
        offsets = np.array([layout.counts[k] for layout in layouts])[phase]
        found = words[(starts + offsets - HEADER_SIZE)[inside] // 4]
        if (found != length).any():
            point = int(np.argmax(found != length))
            raise LayoutError(
                f"{cursor.kind}: the lists of point {point} differ in length from those of the first, see its {field};"
                " all points need the same lists"
            )
    if not inside.all():
        raise LayoutError(
            f"{cursor.kind}: cut off at byte {len(cursor.raw)}, or its points have lists of unequal length"
        )
