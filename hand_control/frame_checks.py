"""What the controller checks of every frame: plausible values, pressures that follow, trajectories within tolerance.

Pressures that differ from what the set-points ask for:

    what                                                         reaction
    above the limit by more than OVER, for OVER_S                vent, latched
    above what the model of the valve expects, NOT_FOLLOWING_S   vent, latched: the joint cannot be released otherwise
    below it, for NOT_FOLLOWING_S                                warning, and the integrators stop: a leak, an empty
                                                                 supply or a closed valve gives less than commanded
The expectation is the set-point through the kernel's valve, whose time constant is lengthened by the dead time, from
the pressure measured at first.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from hand_control.declared import Settings
from hand_model.arrays import Array, Flags
from hand_model.description import Hand
from hand_model.kernel.step import valve_pressure

FINE, NOT_FINITE, JUMPED = range(3)
"""Verdicts of `implausible`."""
OVER = 0.1
"""Share of the pressure limit by which a pressure may exceed it."""
OVER_S = 0.05
NOT_FOLLOWING_S = 0.5
BAND_PA = 2.0e4
BAND = 0.1
"""A pressure follows within BAND_PA plus BAND times the expected pressure."""
FOLLOWING, OVER_PRESSURE, STUCK_HIGH, STUCK_LOW = range(4)
"""Verdicts of `PressureWatch`, the most urgent first after FOLLOWING."""
PATIENCE_S = 0.1
"""Time for which a joint may leave its path: one noisy sample or a push of its partner aborts nothing."""
_EXPECTED, _OVER, _HIGH, _LOW = range(4)


@njit(cache=True)
def implausible(position, velocity, pressure, last_position, max_jump):  # type: ignore[no-untyped-def]
    """Verdict and the joint it concerns: the first that is not finite, else the one with the largest jump.

    position and last_position [rad], velocity [rad/s], pressure [Pa]: (joints,).  max_jump: [rad] between frames.
    """
    worst, largest = 0, max_jump
    for j in range(len(position)):
        if not math.isfinite(position[j] + velocity[j] + pressure[j]):
            return NOT_FINITE, j
        jump = abs(position[j] - last_position[j])
        if jump > largest:
            worst, largest = j, jump
    return (JUMPED if largest > max_jump else FINE), worst


@njit(cache=True)
def _watch(s, valve, limit, command, pressure, dt):  # type: ignore[no-untyped-def]
    verdict, worst = FOLLOWING, 0
    for i in range(len(command)):
        tau, vent, fill = valve[0, i], valve[1, i], valve[2, i]
        s[_EXPECTED, i] = valve_pressure(s[_EXPECTED, i], command[i], tau, vent, fill, dt)
        band = BAND_PA + BAND * s[_EXPECTED, i]
        excess = pressure[i] - s[_EXPECTED, i]
        s[_OVER, i] = s[_OVER, i] + dt if pressure[i] > (1.0 + OVER) * limit[i] else 0.0
        s[_HIGH, i] = s[_HIGH, i] + dt if excess > band else 0.0
        s[_LOW, i] = s[_LOW, i] + dt if excess < -band else 0.0
        found = FOLLOWING
        if s[_OVER, i] > OVER_S:
            found = OVER_PRESSURE
        elif s[_HIGH, i] > NOT_FOLLOWING_S:
            found = STUCK_HIGH
        elif s[_LOW, i] > NOT_FOLLOWING_S:
            found = STUCK_LOW
        if found != FOLLOWING and (verdict == FOLLOWING or found < verdict):
            verdict, worst = found, i
    return verdict, worst


class PressureWatch:
    """Compares the pressures of one hand with its set-points, frame by frame."""

    def __init__(self, hand: Hand) -> None:
        """Expect no pressure; `start` sets the first expectation."""
        lag = hand.row("valve.time_constant_s") + hand.row("valve.dead_time_s")
        self._valve = np.array([lag, hand.row("valve.vent_rate_pa_per_s"), hand.row("valve.fill_rate_pa_per_s")])
        self._limit = np.asarray(hand.limits.max_pressure_pa, dtype=np.float64)
        self._state = np.zeros((4, len(hand.joints)))

    def start(self, pressure: Array) -> None:
        """Expect the measured pressure (n,) [Pa]."""
        self._state[:] = 0.0
        self._state[_EXPECTED] = pressure

    def check(self, command: Array, pressure: Array, dt: float) -> tuple[int, int]:
        """Verdict and its joint after dt [s] under command (n,) [Pa], now at pressure (n,) [Pa]."""
        return _watch(self._state, self._valve, self._limit, command, pressure, dt)  # type: ignore[no-any-return]


class ToleranceWatch:
    """Measures for how long each joint has been outside the tolerance of its trajectory."""

    def __init__(self, hand: Hand) -> None:
        """Begin within the tolerances."""
        self._joints = hand.joints
        self._away_s = np.zeros(len(hand.joints))
        self._late_s = np.zeros(len(hand.joints))

    def check(self, error: Array, on_path: Flags, at_goal: Flags, settings: Settings, dt: float) -> str:
        """One line with the reason to abort, or an empty text.

        error: (n,) [rad].  on_path, at_goal: (n,), joints within a trajectory and past its end.  dt: [s].
        """
        if not (on_path.any() or at_goal.any()):
            self._away_s[:] = self._late_s[:] = 0.0
            return ""
        size_deg = np.degrees(np.abs(error))
        path_deg, goal_deg = settings.path_tolerance_deg, settings.goal_tolerance_deg
        strayed = on_path & (size_deg > path_deg) & (path_deg > 0.0)
        late = at_goal & (size_deg > goal_deg) & (goal_deg > 0.0)
        self._away_s = np.where(strayed, self._away_s + dt, 0.0)
        self._late_s = np.where(late, self._late_s + dt, 0.0)
        for away_s, patience_s, what, allowed_deg in (
            (self._away_s, PATIENCE_S, "is off the path", path_deg),
            (self._late_s, settings.goal_time_s, "is not at the goal", goal_deg),
        ):
            worst = int(np.argmax(away_s))
            if away_s[worst] > patience_s:
                return (
                    f"joint_trajectory aborted: {self._joints[worst]} {what} by {size_deg[worst]:.1f} degrees,"
                    f" {allowed_deg:.1f} are allowed; its joints hold their measured angle"
                )
        return ""
