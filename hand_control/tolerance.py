"""Tolerances of trajectories: how far a joint may stray on the way, and how soon it must be at the goal."""

from __future__ import annotations

import math

import numpy as np

from hand_control.settings import Settings
from hand_model.arrays import Array, Flags
from hand_model.description import Hand

PATIENCE_S = 0.1
"""A joint may stray this long: one noisy sample or a push of its partner aborts nothing."""


class Tolerance:
    """How long each joint has been out of its tolerance."""

    def __init__(self, hand: Hand) -> None:
        """Begin within it."""
        self._joints = hand.joints
        self._away_s = np.zeros(len(hand.joints))
        self._late_s = np.zeros(len(hand.joints))

    def look(self, error: Array, on_path: Flags, at_goal: Flags, settings: Settings, dt: float) -> str:
        """Why to abort, or nothing. error (n,) [rad]; on_path, at_goal (n,): joints within or past a trajectory."""
        if not (on_path.any() or at_goal.any()):
            self._away_s[:] = self._late_s[:] = 0.0
            return ""
        size = np.abs(error)
        strayed = on_path & (size > settings.path_tolerance_rad) & (settings.path_tolerance_rad > 0.0)
        late = at_goal & (size > settings.goal_tolerance_rad) & (settings.goal_tolerance_rad > 0.0)
        self._away_s = np.where(strayed, self._away_s + dt, 0.0)
        self._late_s = np.where(late, self._late_s + dt, 0.0)
        for away, most_s, what, allowed in (
            (self._away_s, PATIENCE_S, "is off the path", settings.path_tolerance_rad),
            (self._late_s, settings.goal_time_s, "is not at the goal", settings.goal_tolerance_rad),
        ):
            worst = int(np.argmax(away))
            if away[worst] > most_s:
                off = math.degrees(float(size[worst]))
                return (
                    f"joint_trajectory aborted: {self._joints[worst]} {what} by {off:.1f} degrees,"
                    f" {math.degrees(allowed):.1f} are allowed; its joints hold where they are"
                )
        return ""
