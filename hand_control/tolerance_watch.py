"""Whether a trajectory is ended: for how long each joint has been outside the tolerance of its path or of its goal."""

from __future__ import annotations

import math

import numpy as np

from hand_control.declared import Settings
from hand_model.arrays import Array, Flags
from hand_model.compile_cache import without_arrays
from hand_model.description import Hand

PATIENCE_S = 0.1
"""Time for which a joint may leave its path: one noisy sample or a push of its partner aborts nothing."""
_AWAY, _LATE = range(2)
"""Rows of the times [s]: off the path, and not at the goal."""


@without_arrays
def _longest(times, row, error, applies, tolerance_deg, dt):  # type: ignore[no-untyped-def]
    """The joint that has been outside tolerance_deg [degrees] for the longest time, dt [s] after the last call.

    times: (2, n) [s], of which a row is updated.  error: (n,) [rad].  applies: (n,).  A tolerance of 0 is none.
    """
    worst = 0
    for i in range(len(error)):
        off = applies[i] and abs(error[i]) * (180.0 / math.pi) > tolerance_deg and tolerance_deg > 0.0
        times[row, i] = times[row, i] + dt if off else 0.0
        if times[row, i] > times[row, worst]:
            worst = i
    return worst


@without_arrays
def _worst(times, error, on_path, at_goal, path_deg, goal_deg, dt):  # type: ignore[no-untyped-def]
    """The joints that have been off the path and not at the goal for the longest time, see `_longest`."""
    off_path = _longest(times, _AWAY, error, on_path, path_deg, dt)
    return off_path, _longest(times, _LATE, error, at_goal, goal_deg, dt)


class ToleranceWatch:
    """Measures for how long each joint has been outside the tolerance of its trajectory."""

    def __init__(self, hand: Hand) -> None:
        """Begin within the tolerances."""
        self._joints = hand.joints
        self._times_s = np.zeros((2, len(hand.joints)))

    def configure(self, settings: Settings) -> bool:
        """Whether new settings have a tolerance to check; without one, as by default, the times begin again."""
        applies = settings.path_tolerance_deg > 0.0 or settings.goal_tolerance_deg > 0.0
        if not applies:
            self._times_s.fill(0.0)
        return applies

    def check(self, error: Array, on_path: Flags, at_goal: Flags, settings: Settings, dt: float) -> str:
        """One line with the reason to abort, or an empty text.

        error: (n,) [rad].  on_path, at_goal: (n,), joints within a trajectory and past its end.  dt: [s].
        """
        path_deg, goal_deg = settings.path_tolerance_deg, settings.goal_tolerance_deg
        worst = _worst(self._times_s, error, on_path, at_goal, path_deg, goal_deg, dt)
        if self._times_s[_AWAY, worst[_AWAY]] > PATIENCE_S:
            return self._line(error, worst[_AWAY], "is off the path", path_deg)
        if self._times_s[_LATE, worst[_LATE]] > settings.goal_time_s:
            return self._line(error, worst[_LATE], "is not at the goal", goal_deg)
        return ""

    def _line(self, error: Array, joint: int, what: str, allowed_deg: float) -> str:
        return (
            f"joint_trajectory aborted: {self._joints[joint]} {what} by {math.degrees(abs(error[joint])):.1f} degrees,"
            f" {allowed_deg:.1f} are allowed; its joints hold their measured angle"
        )
