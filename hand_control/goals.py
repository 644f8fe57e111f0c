"""Goals of the action follow_joint_trajectory: their tolerances, and how each of them ends. No ROS, no clock.

The rules are those of control_msgs/action/FollowJointTrajectory. A tolerance of 0 stands for the setting of the node, a
negative one for none. The path is compared with the trajectory at that time, the goal with the last point. A goal that
is refused, preempted or vented ends with INVALID_GOAL.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hand_control.command_check import MAX_AGE_S, CommandError, Trajectory
from hand_control.references import SLEW_NS
from hand_messages.bounds import MAX_NAMES, shown
from hand_messages.commands import MAX_POINTS
from hand_model.arrays import Array
from hand_model.description import Hand


class Code(IntEnum):
    """Values of error_code in control_msgs/action/FollowJointTrajectory."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


class GoalRefusedError(CommandError):
    """A goal that is not begun. code: its error_code."""

    def __init__(self, code: Code, line: str) -> None:
        """With one line that names what is wrong and what is allowed."""
        super().__init__(line)
        self.code = code


class NamedTolerance(Protocol):
    """As control_msgs/JointTolerance: name, position [rad], velocity [rad/s]; accelerations are not measured."""

    name: str
    position: float
    velocity: float


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Of the joints of one trajectory, (k,) each: position [rad], velocity [rad/s]; infinite for none."""

    position_rad: Array
    velocity_rad_s: Array

    def violated(self, position_error: Array, velocity_error: Array) -> int | None:
        """The first joint (its place in the trajectory) outside; errors are (k,) [rad], [rad/s]."""
        outside = (np.abs(position_error) > self.position_rad) | (np.abs(velocity_error) > self.velocity_rad_s)
        return int(np.argmax(outside)) if outside.any() else None


def read_tolerances(names: Sequence[str], given: Sequence[NamedTolerance], usual_deg: float) -> Tolerances:
    """Tolerances of the joints `names`. usual_deg: setting of the node [deg], 0 for none.

    Raises GoalRefusedError, one line, for a joint that the trajectory does not have or a value that is not finite.
    """
    if len(given) > MAX_NAMES:
        line = f"goal refused: {len(given)} tolerances; at most {MAX_NAMES} are allowed"
        raise GoalRefusedError(Code.INVALID_GOAL, line)
    position = np.full(len(names), math.radians(usual_deg) if usual_deg > 0.0 else math.inf)
    velocity = np.full(len(names), math.inf)
    for entry in given:
        if entry.name not in names:
            line = f"tolerance for {shown(entry.name)}; the joints of the trajectory are {', '.join(names)}"
            raise GoalRefusedError(Code.INVALID_JOINTS, f"goal refused: {line}")
        place = list(names).index(entry.name)
        for column, what in ((position, "position"), (velocity, "velocity")):
            value = getattr(entry, what)
            if not math.isfinite(value):
                line = f"{what} tolerance of {entry.name} is {value:g}; it must be finite, negative for none"
                raise GoalRefusedError(Code.INVALID_GOAL, f"goal refused: {line}")
            if value != 0.0:
                column[place] = value if value > 0.0 else math.inf
    return Tolerances(position, velocity)


def check_names_and_age(hand: Hand, names: Sequence[str], stamp_ns: int, now_ns: int) -> None:
    """The errors of a goal that have codes of their own. Raises GoalRefusedError, one line."""
    for place, name in enumerate(names):
        if name not in hand.joints:
            line = f"unknown joint {shown(name)}; joints are {', '.join(hand.joints)}"
            raise GoalRefusedError(Code.INVALID_JOINTS, f"goal refused: {line}")
        if name in names[:place]:
            raise GoalRefusedError(Code.INVALID_JOINTS, f"goal refused: joint {name!r} appears twice")
    if not names:
        raise GoalRefusedError(
            Code.INVALID_JOINTS, f"goal refused: no joint is named; joints are {', '.join(hand.joints)}"
        )
    age_s = (now_ns - stamp_ns) * 1e-9
    if stamp_ns and age_s > MAX_AGE_S:
        line = f"goal refused: stamp is {age_s:.3f} s old; at most {MAX_AGE_S:g} s is allowed"
        raise GoalRefusedError(Code.OLD_HEADER_TIMESTAMP, line)


def check_size(points: int) -> None:
    """Refuse a goal with too many points before they are read. Raises GoalRefusedError."""
    if points > MAX_POINTS:
        line = f"goal refused: it has {points} points; at most {MAX_POINTS} are allowed"
        raise GoalRefusedError(Code.INVALID_GOAL, line)


def check_fields(given: Mapping[str, Sequence[object]]) -> None:
    """Refuse the fields of a goal that a hand cannot follow. given: their lists by name. Raises GoalRefusedError."""
    for field, values in given.items():
        if len(values):
            line = f"goal refused: {field} is given, but every joint of a hand has one degree of freedom"
            raise GoalRefusedError(Code.INVALID_GOAL, line)


@dataclass(frozen=True, slots=True)
class GoalLimits:
    """What a goal allows. goal_time_s: time to reach the goal after the end of the trajectory; infinite for any."""

    path: Tolerances
    goal: Tolerances
    goal_time_s: float


class TrajectoryGoal:
    """A goal that is being followed.

    end: None while it runs, then its code and one line.  start_ns: start of the trajectory.  index: (k,) its joints.
    final_rad: (k,) [rad] its last point.  desired_rad: (k,) [rad] of the newest step.
    """

    def __init__(self, hand: Hand, trajectory: Trajectory, limits: GoalLimits) -> None:
        """Begin with a trajectory that the references follow already."""
        self._names = [hand.joints[index] for index in trajectory.index]
        self._limits = limits
        self.start_ns, self._end_s = trajectory.start_ns, float(trajectory.times_s[-1])
        self._now_ns = -(2**62)
        self.final_rad: Array = trajectory.position_rad[-1]
        self.index = trajectory.index
        self.desired_rad: Array = trajectory.position_rad[0]
        self.end: tuple[Code, str] | None = None

    def finish(self, code: Code, line: str) -> None:
        """End the goal; the first end counts."""
        if self.end is None:
            self.end = (code, line)

    def step(self, now_ns: int, desired: tuple[Array, Array], measured: tuple[Array, Array]) -> None:
        """Compare with the tolerances.

        desired, measured: angles [rad] and speeds [rad/s], (n,) each in the hand's order.
        """
        if now_ns < self._now_ns - SLEW_NS:
            self.finish(Code.INVALID_GOAL, "the clock was set back")
        self._now_ns = now_ns
        self.desired_rad = desired[0][self.index]
        seconds = (now_ns - self.start_ns) * 1e-9
        if seconds < 0.0 or self.end is not None:
            return
        angle, speed = measured[0][self.index], measured[1][self.index]
        if seconds < self._end_s:
            error = self.desired_rad - angle, desired[1][self.index] - speed
            joint = self._limits.path.violated(*error)
            if joint is not None:
                self._violated(Code.PATH_TOLERANCE_VIOLATED, "is off the path", joint, error, self._limits.path)
            return
        error = self.final_rad - angle, -speed
        joint = self._limits.goal.violated(*error)
        if joint is None:
            self.finish(Code.SUCCESSFUL, "every joint is within its tolerance of the goal")
        elif seconds > self._end_s + self._limits.goal_time_s:
            self._violated(Code.GOAL_TOLERANCE_VIOLATED, "is not at the goal", joint, error, self._limits.goal)

    def _violated(self, code: Code, what: str, joint: int, error: tuple[Array, Array], allowed: Tolerances) -> None:
        angle, speed = (abs(float(values[joint])) for values in error)
        line = (
            f"{self._names[joint]} {what} by {angle:.4f} rad, {allowed.position_rad[joint]:.4f} rad are allowed, "
            f"and by {speed:.3f} rad/s, {allowed.velocity_rad_s[joint]:.3f} rad/s are allowed"
        )
        self.finish(code, line)


class RunningGoals:
    """All goals that are being followed. Their joints are disjoint: a command ends the goals of its joints."""

    def __init__(self) -> None:
        """Without a goal."""
        self._goals: list[TrajectoryGoal] = []

    def add(self, goal: TrajectoryGoal) -> None:
        """Follow another goal."""
        self._goals.append(goal)

    def end(self, line: str, index: NDArray[np.int64] | None = None, code: Code = Code.INVALID_GOAL) -> None:
        """End every goal, or those with one of the joints `index` (k,), for a reason of one line."""
        for goal in self._goals:
            if index is None or np.isin(goal.index, index).any():
                goal.finish(code, line)
        self._goals = [goal for goal in self._goals if goal.end is None]

    def step(self, now_ns: int, desired: tuple[Array, Array], measured: tuple[Array, Array]) -> list[NDArray[np.int64]]:
        """See TrajectoryGoal.step, angles in [rad]; returns the joints (k,) of every goal that was aborted now."""
        for goal in self._goals:
            goal.step(now_ns, desired, measured)
        aborted = [goal.index for goal in self._goals if goal.end is not None and goal.end[0] is not Code.SUCCESSFUL]
        self._goals = [goal for goal in self._goals if goal.end is None]
        return aborted
