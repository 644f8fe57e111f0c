"""The reference of every joint and its torque limit: held poses, steps and trajectories, at a bounded speed.

A joint goes to its goal, or follows its trajectory, by at most the greatest speed times dt a sample; with that a
step becomes a ramp and velocity is 0 once it has arrived. References stay inside the hand's limits.

Who replaces whom, joint by joint: a joint command ends the joint's trajectory, the running one and one that
waits for its start. A trajectory replaces the one that waits, and at its start the one that runs. A latch ends all.

Time: back by up to 0.1 s counts as standing still (clocks are slewed); further back is another clock (a board
or a simulation began anew), whose trajectories no longer mean anything: they are dropped and the reference holds.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hand_control.command_check import JointCommand, Trajectory
from hand_control.trajectory import POSITION, TIME, evaluate, knots_of
from hand_model.description import Hand

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SLEW_NS = 100_000_000
"""Time further back than this is another clock."""
REFERENCE, SPEED, GOAL, LIMIT, LOW, HIGH = range(6)
"""Rows of the state: [rad], [rad/s], [rad], [N m], [rad], [rad]."""
START_NS, COUNT, PIECE = range(3)
"""Rows of the plan: start of the trajectory, its knots (0: none runs), the piece it is in."""


@njit(cache=True, inline="always")
def _follow(state, plan, knots, now_ns, i):  # type: ignore[no-untyped-def]
    """Where trajectory i wants the joint now [rad] and its velocity [rad/s]; at its end it becomes the goal."""
    time = (now_ns - plan[START_NS, i]) * 1e-9
    last = plan[COUNT, i] - 1
    if time >= knots[TIME, i, last]:
        plan[COUNT, i] = 0
        state[GOAL, i] = knots[POSITION, i, last]
        return state[GOAL, i], 0.0
    while time >= knots[TIME, i, plan[PIECE, i] + 1]:
        plan[PIECE, i] += 1
    target, speed = evaluate(knots, i, plan[PIECE, i], time)
    if target < state[LOW, i] or target > state[HIGH, i]:  # velocities of the message may overshoot its points
        return min(max(target, state[LOW, i]), state[HIGH, i]), 0.0
    return target, speed


@njit(cache=True)
def _sample(state, plan, knots, now_ns, dt, max_speed):  # type: ignore[no-untyped-def]
    """Move every reference on by dt [s] > 0.  state (6, n), plan (3, n): changed.  knots (3, n, any)."""
    reach = max_speed * dt
    for i in range(state.shape[1]):
        target, speed = state[GOAL, i], 0.0
        if plan[COUNT, i] > 0:
            target, speed = _follow(state, plan, knots, now_ns, i)
        gap = target - state[REFERENCE, i]
        if abs(gap) > reach:
            state[REFERENCE, i] += np.copysign(reach, gap)
            state[SPEED, i] = np.copysign(max_speed, gap)
        else:
            state[REFERENCE, i] = target
            state[SPEED, i] = min(max(speed, -max_speed), max_speed) if plan[COUNT, i] > 0 else gap / dt


class References:
    """What each joint of a hand is to do now. Commands are taken as checked.

    max_speed_rad_s: greatest speed of any reference; may be set at any time.
    """

    def __init__(self, hand: Hand, max_speed_rad_s: float) -> None:
        """Hold every joint at its lower limit until latched."""
        count = len(hand.joints)
        self.max_speed_rad_s = max_speed_rad_s
        self._configured = hand.limits.max_torque_nm
        self._state = np.zeros((6, count))
        self._state[LOW], self._state[HIGH] = hand.limits.low_rad, hand.limits.high_rad
        self._state[REFERENCE] = hand.limits.low_rad
        self._plan = np.zeros((3, count), dtype=np.int64)
        self._knots = np.zeros((3, count, 2))
        self._waiting: list[Trajectory] = []
        self._now_ns = 0
        self._reference, self._speed, self._limit = self._state[REFERENCE], self._state[SPEED], self._state[LIMIT]
        self._hold()
        self._limit[:] = self._configured

    def latch(self, position_rad: Array, now_ns: int) -> None:
        """Hold position_rad (n,) from now on, cut to the limits; drop trajectories and commanded torque limits.

        A joint whose position is not finite holds its reference.
        """
        pose = np.where(np.isfinite(position_rad), position_rad, self._reference)
        self._reference[:] = np.clip(pose, self._state[LOW], self._state[HIGH])
        self._limit[:] = self._configured
        self._hold()
        self._now_ns = now_ns

    def _hold(self) -> None:
        """Stand still at the present reference, without any plan."""
        self._state[GOAL] = self._reference
        self._speed[:] = 0.0
        self._plan[COUNT] = 0
        self._waiting.clear()

    def command(self, command: JointCommand, now_ns: int) -> None:
        """Send its joints to new goals and set their torque limits; all others go on."""
        index, torque = command.index, command.max_torque_nm
        self._drop_waiting(index)
        self._plan[COUNT, index] = 0
        self._state[GOAL, index] = command.position_rad
        self._limit[index] = np.where(np.isnan(torque), self._configured[index], torque)

    def trajectory(self, trajectory: Trajectory, now_ns: int) -> None:
        """Follow it from its start on, at once where that has passed; all other joints go on."""
        self._drop_waiting(trajectory.index)
        if trajectory.start_ns > now_ns:
            self._waiting.append(trajectory)
        else:
            self._begin(trajectory, now_ns)

    def _drop_waiting(self, index: Index) -> None:
        """Take these joints out of the trajectories that wait."""
        kept = ((waiting, ~np.isin(waiting.index, index)) for waiting in self._waiting)
        self._waiting = [_columns(waiting, keep) for waiting, keep in kept if keep.any()]

    def _begin(self, trajectory: Trajectory, now_ns: int) -> None:
        """Replace the plans of its joints."""
        index = trajectory.index
        elapsed_s = (now_ns - trajectory.start_ns) * 1e-9
        knots = knots_of(trajectory, elapsed_s, self._reference[index], self._speed[index], self.max_speed_rad_s)
        count = knots.shape[2]
        room = count - self._knots.shape[2]
        if room > 0:
            self._knots = np.pad(self._knots, ((0, 0), (0, 0), (0, room)))
        self._knots[:, index, :count] = knots
        self._plan[START_NS, index] = trajectory.start_ns
        self._plan[COUNT, index] = count
        self._plan[PIECE, index] = 0

    def sample(self, now_ns: int, dt_s: float) -> tuple[Array, Array, Array]:
        """Reference [rad], its velocity [rad/s] and torque limit [N m], (n,) each, dt_s after the last sample.

        The arrays are this object's own and change with the next call. Where dt_s is not above 0 nothing moves.
        """
        if now_ns < self._now_ns:
            now_ns = self._back(now_ns)
        self._now_ns = now_ns
        if self._waiting:
            self._begin_due(now_ns)
        if dt_s > 0.0:
            _sample(self._state, self._plan, self._knots, now_ns, dt_s, self.max_speed_rad_s)
        return self._reference, self._speed, self._limit

    def _back(self, now_ns: int) -> int:
        """Time went back: the time to go on with."""
        if self._now_ns - now_ns <= SLEW_NS:
            return self._now_ns
        if self._waiting or self._plan[COUNT].any():
            self._end_plans()
        return now_ns

    def _end_plans(self) -> None:
        """Joints under way on a trajectory hold; goals of commands stay."""
        running = self._plan[COUNT] > 0
        self._state[GOAL, running] = self._reference[running]
        self._plan[COUNT] = 0
        self._waiting.clear()

    def _begin_due(self, now_ns: int) -> None:
        """Begin the trajectories whose start has come."""
        due = [waiting for waiting in self._waiting if waiting.start_ns <= now_ns]
        self._waiting = [waiting for waiting in self._waiting if waiting.start_ns > now_ns]
        for trajectory in due:
            self._begin(trajectory, now_ns)


def _columns(trajectory: Trajectory, keep: NDArray[np.bool_]) -> Trajectory:
    """A trajectory of some of its joints only: keep (k,)."""
    velocity = None if trajectory.velocity is None else trajectory.velocity[:, keep]
    return replace(trajectory, index=trajectory.index[keep], position=trajectory.position[:, keep], velocity=velocity)
