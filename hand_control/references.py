"""The reference of each joint: the last command or a running trajectory, and its torque limit or target.

Trajectories begin at the present reference. Between points they are cubic Hermite splines with the velocities given;
without velocities, with the slopes of a monotone cubic (Fritsch and Carlson 1980: no overshoot between points),
which are 0 at both ends. The end point is held. A later message replaces an earlier one for its own joints only;
a trajectory that starts later does not change the running ones until then.

When time goes back, the clock is another one, that of a board or a simulation that was restarted. Start times on the
old clock have no meaning then: trajectories are dropped and the targets hold.

In torque mode the effort of a command is the target, and a missing effort is zero torque; the angles stand still.
`shaping.py` makes a motion within the limits of what is sampled here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hand_control.command_check import MIN_STEP_S, JointCommand, Trajectory
from hand_control.hermite import HermiteCurve, monotone_slopes
from hand_model.arrays import Array, Flags
from hand_model.description import Hand

SLEW_NS = 100_000_000
"""Clocks are slewed back by less than this; a larger step back is another clock."""


@dataclass(frozen=True, slots=True)
class _Motion:
    """A running trajectory: its remaining joints, their columns in the curve, and the curve."""

    joints: NDArray[np.int64]
    columns: NDArray[np.int64]
    start_ns: int
    end_s: float
    curve: HermiteCurve

    def without(self, taken: NDArray[np.int64]) -> _Motion:
        """The same motion without the joints that another command has taken."""
        keep = ~np.isin(self.joints, taken)
        return replace(self, joints=self.joints[keep], columns=self.columns[keep])


class References:
    """Target angle [rad], its speed [rad/s] and torque limit [N m] of every joint, (n,) each."""

    def __init__(self, hand: Hand) -> None:
        """Begin at the lower limits; latch before use."""
        self._hand = hand
        self._target = hand.limits.low_rad.copy()
        self._speed = np.zeros(len(hand.joints))
        self._torque_mode = False
        self._limit = self._without_effort()
        self._motions: list[_Motion] = []
        self._waiting: list[Trajectory] = []
        self._now_ns = 0
        self._on_path = np.zeros(len(hand.joints), dtype=np.bool_)
        self._at_goal = np.zeros(len(hand.joints), dtype=np.bool_)

    @property
    def torque_mode(self) -> bool:
        """Whether efforts are targets; otherwise they are limits."""
        return self._torque_mode

    def latch_in_mode(self, torque_mode: bool, position_rad: Array) -> None:
        """Change the meaning of efforts, and latch position_rad (n,)."""
        self._torque_mode = torque_mode
        self.latch(position_rad)

    def _without_effort(self) -> Array:
        """Torques (n,) [N m] of joints that are commanded without an effort: the limit, or no torque as a target."""
        most = self._hand.limits.max_torque_nm
        return np.zeros_like(most) if self._torque_mode else most.copy()

    @property
    def motion(self) -> tuple[Flags, Flags]:
        """(n,) each: joints within a trajectory, and joints past the end of their last one."""
        return self._on_path, self._at_goal

    def hold(self, position_rad: Array, joints: Flags) -> None:
        """Hold some joints (n,) at position_rad (n,) or the nearest limit, and end their trajectories.

        Their torque limits stay. In torque mode they get no torque.
        """
        index = np.flatnonzero(joints)
        self._take(index)
        self._drop_waiting(index)
        limits = self._hand.limits
        self._target[index] = np.clip(position_rad, limits.low_rad, limits.high_rad)[index]
        self._speed[index] = 0.0
        if self._torque_mode:
            self._limit[index] = 0.0

    def latch(self, position_rad: Array) -> None:
        """Hold position_rad (n,) or the nearest limit, with the torques of no command and without trajectories.

        A joint whose position is NaN keeps its target.
        """
        limits = self._hand.limits
        target = np.where(np.isfinite(position_rad), position_rad, self._target)
        self._target = np.clip(target, limits.low_rad, limits.high_rad)
        self._speed = np.zeros_like(self._speed)
        self._limit = self._without_effort()
        self._motions = []
        self._waiting = []
        self._on_path[:] = self._at_goal[:] = False

    def command(self, command: JointCommand) -> None:
        """Go to the commanded angles, or to the commanded torques in torque mode."""
        self._take(command.index)
        self._drop_waiting(command.index)
        if not self._torque_mode:
            self._target[command.index] = command.position_rad
            self._speed[command.index] = 0.0
        missing = self._without_effort()[command.index]
        self._limit[command.index] = np.where(np.isnan(command.max_torque_nm), missing, command.max_torque_nm)

    def trajectory(self, trajectory: Trajectory) -> None:
        """Follow a trajectory from its start time on, beginning at the target and speed of that moment."""
        self._drop_waiting(trajectory.index)
        self._waiting.append(trajectory)

    def _begin(self, trajectory: Trajectory) -> None:
        index = trajectory.index
        times, position, velocity = trajectory.times_s, trajectory.position_rad, trajectory.velocity_rad_s
        if times[0] >= MIN_STEP_S:
            times = np.concatenate([[0.0], times])
            position = np.vstack([self._target[index], position])
            if velocity is not None:
                velocity = np.vstack([self._speed[index], velocity])
        self._take(index)
        curve = _curve(times, position, velocity)
        end_s = float(times[-1])
        columns = np.arange(len(index))
        self._motions.append(_Motion(index, columns, trajectory.start_ns, end_s, curve))

    def sample(self, now_ns: int) -> tuple[Array, Array, Array]:
        """Targets, their speeds and the torque limits now; later calls overwrite the arrays."""
        if now_ns < self._now_ns - SLEW_NS:
            self._drop_trajectories()
        self._now_ns = now_ns
        if self._waiting:
            self._begin_due(now_ns)
        if not self._motions:
            return self._target, self._speed, self._limit
        for motion in self._motions:
            seconds = (now_ns - motion.start_ns) * 1e-9
            if seconds < 0.0:
                continue
            over = seconds >= motion.end_s
            at = min(seconds, motion.end_s)
            position, speed = motion.curve.at(at)
            self._target[motion.joints] = position[motion.columns]
            self._speed[motion.joints] = 0.0 if over else speed[motion.columns]
            self._on_path[motion.joints], self._at_goal[motion.joints] = not over, over
        self._motions = [m for m in self._motions if (now_ns - m.start_ns) * 1e-9 < m.end_s]
        # A curve with large velocities may exceed its points, but never the limits of the joint.
        np.clip(self._target, self._hand.limits.low_rad, self._hand.limits.high_rad, out=self._target)
        return self._target, self._speed, self._limit

    def _begin_due(self, now_ns: int) -> None:
        due = [waiting for waiting in self._waiting if waiting.start_ns <= now_ns]
        self._waiting = [waiting for waiting in self._waiting if waiting.start_ns > now_ns]
        for trajectory in due:
            self._begin(trajectory)

    def _drop_trajectories(self) -> None:
        """Drop all trajectories and hold the targets."""
        self._motions = []
        self._waiting = []
        self._speed[:] = 0.0
        self._on_path[:] = self._at_goal[:] = False

    def _drop_waiting(self, index: NDArray[np.int64]) -> None:
        kept = ((waiting, ~np.isin(waiting.index, index)) for waiting in self._waiting)
        self._waiting = [_columns(waiting, keep) for waiting, keep in kept if keep.any()]

    def _take(self, index: NDArray[np.int64]) -> None:
        self._on_path[index] = self._at_goal[index] = False
        motions = (motion.without(index) for motion in self._motions)
        self._motions = [motion for motion in motions if len(motion.joints)]


def _columns(trajectory: Trajectory, keep: Flags) -> Trajectory:
    """The trajectory of the joints with keep (k,)."""
    velocity = None if trajectory.velocity_rad_s is None else trajectory.velocity_rad_s[:, keep]
    position = trajectory.position_rad[:, keep]
    return replace(trajectory, index=trajectory.index[keep], position_rad=position, velocity_rad_s=velocity)


def _curve(times: Array, position: Array, velocity: Array | None) -> HermiteCurve:
    """Curve through positions (m, k) at times (m,); a single point is held."""
    if len(times) == 1:
        times, position = np.array([0.0, max(times[0], 1e-3)]), np.vstack([position, position])
        velocity = None
    return HermiteCurve(times, position, monotone_slopes(times, position) if velocity is None else velocity)
