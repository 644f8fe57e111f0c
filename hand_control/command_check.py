"""Checks of commands: a command is refused as a whole, in one line, or converted to arrays in the hand's order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hand_messages.bounds import shown
from hand_messages.commands import MAX_POINTS
from hand_model.arrays import Array
from hand_model.description import Hand

Index = NDArray[np.int64]
Points = Sequence[tuple[float, Sequence[float], Sequence[float]]]

JOINT_COMMANDS = "joint_commands"
MAX_AGE_S = 0.5
"""A command with an older stamp is refused."""
MAX_AHEAD_S = 0.1
"""A joint command with a stamp further ahead is of another clock."""
MAX_DELAY_S = 10.0
"""Largest delay of the start of a trajectory, by a stamp ahead of time."""
MAX_DURATION_S = 3600.0
MIN_STEP_S = 0.5e-9
"""Least distance of points: one step of the message's clock, 1 ns, with rounding."""
MAX_SPEED_RAD_S = 100.0
"""Larger velocities are not those of a finger, and their powers overflow."""


class CommandError(ValueError):
    """The whole command is refused; the message is one line."""


@dataclass(frozen=True, slots=True)
class JointCommand:
    """index (k,) of the joints, position_rad (k,), max_torque_nm (k,) with NaN where no effort is given.

    position_rad is NaN where a command in torque mode gives efforts alone.
    """

    index: Index
    position_rad: Array
    max_torque_nm: Array


@dataclass(frozen=True, slots=True)
class Trajectory:
    """index (k,), start_ns, times_s (m,) from the start, position_rad (m, k), velocity_rad_s (m, k) or None."""

    index: Index
    start_ns: int
    times_s: Array
    position_rad: Array
    velocity_rad_s: Array | None


def check_joint_command(
    hand: Hand, names: Sequence[str], position: Sequence[float], effort: Sequence[float], stamp_ns: int, now_ns: int
) -> JointCommand:
    """A joint_commands message; stamps are [ns], 0 means now. Raises CommandError."""
    _check_stamp(JOINT_COMMANDS, stamp_ns, now_ns, MAX_AHEAD_S)
    index = _joints(JOINT_COMMANDS, hand, names)
    if len(effort) and not len(position):
        raise CommandError(f"{JOINT_COMMANDS} refused: efforts without positions; set control_mode to torque for those")
    angle = _angles(hand, index, names, position)
    return JointCommand(index, angle, _efforts(hand, index, names, effort, ("maximum torque", "the configured limit")))


def check_torque_command(
    hand: Hand, names: Sequence[str], position: Sequence[float], effort: Sequence[float], stamp_ns: int, now_ns: int
) -> JointCommand:
    """A joint_commands message in torque mode; positions may be missing. Raises CommandError."""
    _check_stamp(JOINT_COMMANDS, stamp_ns, now_ns, MAX_AHEAD_S)
    index = _joints(JOINT_COMMANDS, hand, names)
    angle = _angles(hand, index, names, position) if len(position) else np.full(len(index), np.nan)
    return JointCommand(index, angle, _efforts(hand, index, names, effort, ("torque", "no torque")))


def _angles(hand: Hand, index: Index, names: Sequence[str], position: Sequence[float]) -> Array:
    _check_length(JOINT_COMMANDS, "positions", position, names)
    angle = np.array(position, dtype=np.float64)
    _check_angles(JOINT_COMMANDS, hand, index, angle)
    return angle


def _efforts(hand: Hand, index: Index, names: Sequence[str], effort: Sequence[float], words: tuple[str, str]) -> Array:
    """Efforts (k,) [N m], NaN where none is given. words: what an effort is, and what replaces a missing one."""
    if not len(effort):
        return np.full(len(index), np.nan)
    _check_length(JOINT_COMMANDS, "efforts", effort, names)
    torque = np.array(effort, dtype=np.float64)
    for joint, value, most in zip(index, torque, hand.limits.max_torque_nm[index], strict=True):
        if not (np.isnan(value) or 0.0 <= value <= most):
            raise CommandError(
                f"{JOINT_COMMANDS} refused: {hand.joints[joint]} {words[0]} is {value:g} N m; "
                f"the allowed range is 0 to {most:g} N m, or NaN for {words[1]}"
            )
    return torque


def check_stop(hand: Hand, names: Sequence[str], stamp_ns: int, now_ns: int) -> Index:
    """A joint_trajectory message without points: the joints (k,) that stop, all where none is named.

    Raises CommandError.
    """
    topic = "joint_trajectory"
    _check_stamp(topic, stamp_ns, now_ns, MAX_DELAY_S)
    return _joints(topic, hand, names) if len(names) else np.arange(len(hand.joints))


def unused_fields(topic: str, names: Sequence[str], fields: Mapping[str, Sequence[Sequence[float]]]) -> str:
    """One line that names the given fields that have no effect; empty where none is given.

    fields: lists of values by the name of the field.  Raises CommandError where a list has a wrong length or a value
    that is not finite: such a message is broken.
    """
    given = []
    for field, lists in fields.items():
        for values in lists:
            if not len(values):
                continue
            _check_length(topic, field, values, names)
            bad = ~np.isfinite(np.array(values, dtype=np.float64))
            if bad.any():
                joint = int(np.argmax(bad))
                raise CommandError(f"{topic} refused: {names[joint]} has {values[joint]:g} in {field}")
            if field not in given:
                given.append(field)
    return f"{topic}: fields without effect: {', '.join(given)}" if given else ""


def check_trajectory(hand: Hand, names: Sequence[str], points: Points, stamp_ns: int, now_ns: int) -> Trajectory:
    """A joint_trajectory message, points of (time [s], positions, velocities). Raises CommandError."""
    topic = "joint_trajectory"
    _check_stamp(topic, stamp_ns, now_ns, MAX_DELAY_S)
    index = _joints(topic, hand, names)
    if not 1 <= len(points) <= MAX_POINTS:
        count = len(points) or "no"
        raise CommandError(f"{topic} refused: {count} points; the allowed range is 1 to {MAX_POINTS}")
    times = np.array([time for time, _, _ in points], dtype=np.float64)
    if not np.all((times >= 0.0) & (times <= MAX_DURATION_S)) or np.any(np.diff(times) < MIN_STEP_S):
        raise CommandError(
            f"{topic} refused: times from start are {_short(times)} s; "
            f"they must ascend within 0 to {MAX_DURATION_S:g} s"
        )
    for _, angles, _ in points:
        _check_length(topic, "positions", angles, names)
    position = np.array([angles for _, angles, _ in points], dtype=np.float64)
    low, high = hand.limits.low_rad[index], hand.limits.high_rad[index]
    wrong = ~((position >= low) & (position <= high)).all(axis=1)  # NaN fails both comparisons
    if wrong.any():
        _check_angles(topic, hand, index, position[int(np.argmax(wrong))])
    start_ns = max(stamp_ns, now_ns) if stamp_ns else now_ns
    return Trajectory(index, start_ns, times, position, _velocities(topic, names, points))


def _velocities(topic: str, names: Sequence[str], points: Points) -> Array | None:
    given = [len(velocity) > 0 for _, _, velocity in points]
    if not any(given):
        return None
    if not all(given):
        raise CommandError(f"{topic} refused: velocities at some points only; give them at all points or at none")
    for _, _, velocity in points:
        _check_length(topic, "velocities", velocity, names)
    values = np.array([velocity for _, _, velocity in points], dtype=np.float64)
    bad = ~(np.abs(values) <= MAX_SPEED_RAD_S)  # NaN fails the comparison
    if bad.any():
        point, column = np.argwhere(bad)[0]
        raise CommandError(
            f"{topic} refused: {names[column]} velocity is {values[point, column]:g} rad/s; "
            f"the allowed range is {-MAX_SPEED_RAD_S:g} to {MAX_SPEED_RAD_S:g} rad/s"
        )
    return values


def _check_stamp(topic: str, stamp_ns: int, now_ns: int, ahead_s: float) -> None:
    if stamp_ns == 0:
        return
    age_s = (now_ns - stamp_ns) * 1e-9
    if age_s > MAX_AGE_S:
        raise CommandError(f"{topic} refused: stamp is {age_s:.3f} s old; at most {MAX_AGE_S:g} s is allowed")
    if age_s < -ahead_s:
        raise CommandError(f"{topic} refused: stamp is {-age_s:.3f} s in the future; at most {ahead_s:g} s is allowed")


def _joints(topic: str, hand: Hand, names: Sequence[str]) -> Index:
    if not len(names):
        raise CommandError(f"{topic} refused: no joint is named; joints are {', '.join(hand.joints)}")
    known = {joint: index for index, joint in enumerate(hand.joints)}
    seen = set[str]()
    for name in names:
        if name not in known:
            raise CommandError(f"{topic} refused: unknown joint {shown(name)}; joints are {', '.join(hand.joints)}")
        if name in seen:
            raise CommandError(f"{topic} refused: joint {name!r} appears twice")
        seen.add(name)
    return np.array([known[name] for name in names], dtype=np.int64)


def _check_length(topic: str, what: str, values: Sequence[float], names: Sequence[str]) -> None:
    if len(values) != len(names):
        raise CommandError(f"{topic} refused: {len(values)} {what} for {len(names)} joints; one each is needed")


def _check_angles(topic: str, hand: Hand, index: Index, angle: Array) -> None:
    low, high = hand.limits.low_rad[index], hand.limits.high_rad[index]
    bad = ~((angle >= low) & (angle <= high))  # NaN fails both comparisons
    if bad.any():
        k = int(np.argmax(bad))
        raise CommandError(
            f"{topic} refused: {hand.joints[index[k]]} position is {angle[k]:.9g} rad; "
            f"the allowed range is {low[k]:.4f} to {high[k]:.4f} rad ({np.degrees(low[k]):.0f} to "
            f"{np.degrees(high[k]):.0f} degrees)"
        )


def _short(times: Array) -> str:
    shown = ", ".join(f"{time:g}" for time in times[:4])
    return shown + (", ..." if len(times) > 4 else "")
