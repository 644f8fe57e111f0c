"""Commands from outside, checked whole: what passes is finite, complete and inside the hand's limits.

A message with anything wrong in it is refused as a whole, with one line: topic, joint, value, allowed range.
Stamps: 0 means now. A command may be 0.5 s old at most and 0.1 s ahead (clocks differ a little); a trajectory
stamped up to 10 s ahead starts at its stamp.
"""

from __future__ import annotations

import reprlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hand_model.description import Hand

Array = NDArray[np.float64]
Index = NDArray[np.int64]

MAX_AGE_S = 0.5
MAX_AHEAD_S = 0.1
MAX_START_S = 10.0
"""A trajectory starts this far ahead at most."""
MAX_DURATION_S = 3600.0
MAX_POINTS = 10_000
"""Longer trajectories would keep the control loop waiting while they are read."""
MIN_STEP_S = 0.5e-9
"""Two points are apart by a tick of the message's clock, 1 ns, but for rounding."""


class CommandError(ValueError):
    """A command that is refused: one line for the sender."""


@dataclass(frozen=True, slots=True)
class JointCommand:
    """Targets of k joints: index (k,) in the hand's order, position (k,) [rad], torque (k,) [N m].

    NaN torque: the configured limit.
    """

    index: Index
    position_rad: Array
    max_torque_nm: Array


@dataclass(frozen=True, slots=True)
class Trajectory:
    """m points of k joints: times_s (m,) after start_ns, position (m, k) [rad], velocity (m, k) [rad/s] or None."""

    index: Index
    start_ns: int
    times_s: Array
    position: Array
    velocity: Array | None


def check_stamp(topic: str, stamp_ns: int, now_ns: int, max_ahead_s: float = MAX_AHEAD_S) -> None:
    """Raise CommandError unless the stamp is 0 (now) or close enough to now."""
    age_s = (now_ns - stamp_ns) * 1e-9
    if stamp_ns == 0 or -max_ahead_s <= age_s <= MAX_AGE_S:
        return
    stands = f"{age_s:.3f} s old" if age_s > 0.0 else f"{-age_s:.3f} s ahead"
    allowed = f"{MAX_AGE_S:g} s old to {max_ahead_s:g} s ahead, or 0 for now"
    raise CommandError(f"{topic}: the stamp is {stands}; the allowed range is {allowed}")


def check_joint_command(
    hand: Hand,
    names: Sequence[str],
    position: Sequence[float],
    effort: Sequence[float],
    stamp_ns: int,
    now_ns: int,
) -> JointCommand:
    """Take a joint_commands message: partial lists of joints, position [rad], effort [N m] empty or one a joint.

    Raises CommandError for anything that is not right. Velocities of the message have no meaning here.
    """
    topic = "joint_commands"
    check_stamp(topic, stamp_ns, now_ns)
    index = _indices(topic, hand, names)
    target = _row(topic, "position", position, names)
    torque = _row(topic, "effort", effort, names) if len(effort) else np.full(len(index), np.nan)
    _check_positions(topic, hand, index, target[None])
    _check_torques(topic, hand, index, torque)
    return JointCommand(index, target, torque)


def check_trajectory(
    hand: Hand,
    joint_names: Sequence[str],
    points: Sequence[tuple[float, Sequence[float], Sequence[float]]],
    stamp_ns: int,
    now_ns: int,
) -> Trajectory:
    """Take a joint_trajectory message: points of (time from start [s], positions [rad], velocities [rad/s]).

    Velocities are given at every point or at none. Raises CommandError for anything that is not right.
    """
    topic = "joint_trajectory"
    check_stamp(topic, stamp_ns, now_ns, MAX_START_S)
    index = _indices(topic, hand, joint_names)
    if not 1 <= len(points) <= MAX_POINTS:
        raise CommandError(f"{topic}: {len(points)} points; the allowed range is 1 to {MAX_POINTS}")
    times = _times(topic, [time for time, _, _ in points])
    position = np.array([_row(_at(topic, n), "positions", row, joint_names) for n, (_, row, _) in enumerate(points)])
    _check_positions(topic, hand, index, position, numbered=True)
    velocity = _velocities(topic, [row for _, _, row in points], joint_names)
    return Trajectory(index, stamp_ns or now_ns, times, position, velocity)


def _at(topic: str, number: int) -> str:
    return f"{topic}: points[{number}]"


def _indices(topic: str, hand: Hand, names: Sequence[str]) -> Index:
    """Place of each joint in the hand; at least one, all known, none twice."""
    if not len(names):
        raise CommandError(f"{topic}: no joint is named; allowed are {', '.join(hand.joints)}")
    for place, name in enumerate(names):
        if name not in hand.joints:
            raise CommandError(f"{topic}: unknown joint {reprlib.repr(name)}; allowed are {', '.join(hand.joints)}")
        if name in names[:place]:
            raise CommandError(f"{topic}: joint {name} is named twice; each joint is allowed once")
    return np.array([hand.joints.index(name) for name in names], dtype=np.int64)


def _row(where: str, field: str, values: Sequence[float], names: Sequence[str]) -> Array:
    """One value a joint, as an array of its own."""
    if len(values) != len(names):
        joints = f"{len(names)} joint{'s' if len(names) > 1 else ''}"
        raise CommandError(f"{where}: {field} has {len(values)} values for {joints}; it must have {len(names)}")
    return np.array(values, dtype=np.float64)


def _check_positions(topic: str, hand: Hand, index: Index, position: Array, numbered: bool = False) -> None:
    """Raise for the first position (m, k) that is not inside the limits of its joint; NaN and inf never are."""
    low, high = hand.limits.low_rad[index], hand.limits.high_rad[index]
    good = (low <= position) & (position <= high)
    if good.all():
        return
    number, column = (int(k) for k in np.argwhere(~good)[0])
    value, low_rad, high_rad = position[number, column], low[column], high[column]
    where = _at(topic, number) if numbered else topic
    shown = f"{value:.9g} rad ({np.degrees(value):.7g} deg)" if np.isfinite(value) else f"{value}"
    raise CommandError(
        f"{where}: position of {hand.joints[index[column]]} is {shown}; the allowed range is "
        f"{low_rad:.9g} to {high_rad:.9g} rad ({np.degrees(low_rad):.7g} to {np.degrees(high_rad):.7g} deg)"
    )


def _check_torques(topic: str, hand: Hand, index: Index, torque: Array) -> None:
    """Raise for the first greatest torque (k,) out of range; NaN stands for the configured limit."""
    limit = hand.limits.max_torque_nm[index]
    good = np.isnan(torque) | ((torque >= 0.0) & (torque <= limit))
    if not good.all():
        column = int(np.argmin(good))
        raise CommandError(
            f"{topic}: effort of {hand.joints[index[column]]} is {torque[column]:.9g} N m; "
            f"the allowed range is 0 to {limit[column]:.9g} N m, or NaN for the configured limit"
        )


def _times(topic: str, times: Sequence[float]) -> Array:
    """Times from the start [s]: each in range and after the one before."""
    before = -np.inf
    for number, time in enumerate(times):
        if not 0.0 <= time <= MAX_DURATION_S:
            problem = f"time_from_start is {time:.9g} s; the allowed range is 0 to {MAX_DURATION_S:g} s"
            raise CommandError(f"{_at(topic, number)}: {problem}")
        if time - before < MIN_STEP_S:
            problem = f"time_from_start is {time:.9g} s; it must be after that of the point before, {before:.9g} s"
            raise CommandError(f"{_at(topic, number)}: {problem}")
        before = time
    return np.array(times, dtype=np.float64)


def _velocities(topic: str, rows: Sequence[Sequence[float]], names: Sequence[str]) -> Array | None:
    """Velocities (m, k), or None where no point has any."""
    if not any(len(row) for row in rows):
        return None
    velocity = np.array([_row(_at(topic, number), "velocities", row, names) for number, row in enumerate(rows)])
    good = np.isfinite(velocity)
    if not good.all():
        number, column = (int(k) for k in np.argwhere(~good)[0])
        problem = f"velocity of {names[column]} is {velocity[number, column]}; it must be a finite number"
        raise CommandError(f"{_at(topic, number)}: {problem}")
    return velocity
