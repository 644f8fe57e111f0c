"""The controller of one hand: references, safety and the law, composed. No ROS; every time is an argument."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hand_control.command_check import check_joint_command, check_trajectory
from hand_control.law import PRESSURE, SATURATED, TORQUE, Law, gains
from hand_control.plausibility import JUMPED, NOT_FINITE, implausible
from hand_control.references import References
from hand_control.settings import Settings
from hand_control.shaping import Shaper
from hand_control.supervisor import VENT_S, Phase, Supervisor
from hand_model.description import Hand
from hand_ros.health import Health, Level

Array = NDArray[np.float64]
REFUSAL_S = 5.0
"""A refused command is shown on diagnostics this long."""
FUTURE_S = 0.1
"""A frame stamped further ahead than this comes from another clock."""
MAX_DT_S = 0.05
"""Longest step the law is told; a longer gap says nothing of the motion in it."""


@dataclass(slots=True)
class Tick:
    """What one frame led to; arrays (n,) in the hand's order, overwritten by the next tick.

    reference, position, error [rad]; pressure_command [Pa]; torque_estimate, torque_limit [N m].
    """

    stamp_ns: int
    reference: Array
    position: Array
    error: Array
    pressure_command: Array
    torque_estimate: Array
    torque_limit: Array
    saturated: NDArray[np.bool_]
    contact: NDArray[np.bool_]


class Controller:
    """Turns measurements and commands into valve pressures, and vents when in doubt."""

    def __init__(self, hand: Hand, settings: Settings) -> None:
        """Begin vented."""
        count = len(hand.joints)
        self.hand = hand
        self.safety = Supervisor()
        self._references = References(hand)
        self._shaper = Shaper(count)
        self._law = Law(np.zeros((0, 0)))
        self._last_position = np.full(count, np.nan)
        self._stamp_ns: int | None = None
        self._refusal: tuple[int, str] | None = None
        self._no_contact = np.zeros(count, dtype=np.bool_)
        self._limit = hand.limits.max_torque_nm.copy()
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Take over settings; integrators and references stay, so nothing jumps."""
        state = self._law.state if self._law.gains.size else None
        self.settings = settings
        gain_rows = gains(self.hand, settings.kp, settings.ki, settings.kd, settings.integral_limit)
        self._law = Law(gain_rows)
        if state is not None:
            self._law.state[:] = state

    def enable(self, on: bool) -> None:
        """Drive the hand from its present pose, or vent it. ValueError while a fault is latched."""
        if on:
            self.safety.enable()
        else:
            self.vent("disabled on request")

    def vent(self, reason: str) -> None:
        """Vent now, without latching."""
        self.safety.vent(reason)

    def reset(self) -> str:
        """Forget a latched fault; returns it, empty where there was none."""
        return self.safety.reset()

    def command(
        self,
        names: Sequence[str],
        position: Sequence[float],
        effort: Sequence[float],
        stamp_ns: int,
        now_ns: int,
        host_ns: int,
    ) -> None:
        """Follow a joint command (partial lists allowed). ValueError: refused whole, one line."""
        try:
            self._accept()
            checked = check_joint_command(self.hand, names, position, effort, stamp_ns, now_ns)
        except ValueError as error:
            self._refuse(str(error), host_ns)
            raise
        self._references.command(checked)
        self.safety.command(host_ns)

    def trajectory(
        self,
        names: Sequence[str],
        points: Sequence[tuple[float, Sequence[float], Sequence[float]]],
        stamp_ns: int,
        now_ns: int,
        host_ns: int,
    ) -> None:
        """Follow a trajectory of (time [s], positions, velocities). ValueError: refused whole, one line."""
        try:
            self._accept()
            checked = check_trajectory(self.hand, names, points, stamp_ns, now_ns)
        except ValueError as error:
            self._refuse(str(error), host_ns)
            raise
        self._references.trajectory(checked)
        self.safety.command(host_ns)

    def _accept(self) -> None:
        if self.safety.phase is not Phase.ACTIVE:
            reason = self.safety.fault or self.safety.reason or self.safety.phase.value
            raise ValueError(f"command refused: the hand is not being controlled ({reason})")

    def _refuse(self, line: str, host_ns: int) -> None:
        self._refusal = (host_ns, line)

    def frame(
        self, stamp_ns: int, now_ns: int, host_ns: int, position: Array, velocity: Array, pressure: Array
    ) -> Tick | None:
        """One frame, arrays (n,) in the hand's order. None: it was no new frame and nothing is to be sent.

        stamp_ns: acquisition time; now_ns: the same clock, now.  host_ns: the host's monotonic clock, which
        also runs while a simulated clock stands still.
        """
        dt = 0.0 if self._stamp_ns is None else (stamp_ns - self._stamp_ns) * 1e-9
        age_s = (now_ns - stamp_ns) * 1e-9
        if not -FUTURE_S <= age_s <= VENT_S:
            return None  # stale or from another clock: for the supervisor it never came
        if self._stamp_ns is not None and -1.0 < dt <= 0.0:
            return None  # repeated or out of order
        self._stamp_ns = stamp_ns
        fresh = self.safety.frame(host_ns)
        if self.safety.phase is not Phase.VENTED:
            self._judge(position, velocity, pressure, host_ns)
        self.safety.check(host_ns, self.settings.command_timeout_s)
        if self.safety.phase is not Phase.ACTIVE:
            return self._vented(stamp_ns, position, pressure)
        if self.safety.command_held(host_ns, self.settings.command_timeout_s):
            self._references.latch(self._shaper.r)
        return self._drive(stamp_ns, now_ns, min(max(dt, 0.0), MAX_DT_S), fresh, position, velocity, pressure)

    def check(self, host_ns: int) -> bool:
        """Between frames: whether the hand has just become vented and a vent is to be sent."""
        before = self.safety.phase
        self.safety.check(host_ns, self.settings.command_timeout_s)
        return before is Phase.ACTIVE and self.safety.phase is Phase.VENTED

    def _judge(self, position: Array, velocity: Array, pressure: Array, host_ns: int) -> None:
        """Trip on what cannot be; arm on the first measurement that can."""
        verdict, worst = implausible(position, velocity, pressure, self._last_position, self.settings.max_jump_rad)
        if verdict == NOT_FINITE:
            if self.safety.phase is Phase.ACTIVE:
                self.safety.trip(f"{self.hand.joints[worst]}: the measurement is not a number")
            return
        if self.safety.phase is Phase.ARMING:
            self._arm(position, host_ns)
            return
        if verdict == JUMPED:
            jump = math.degrees(abs(position[worst] - self._last_position[worst]))
            self.safety.trip(f"{self.hand.joints[worst]}: angle jumped by {jump:.0f} degrees")
        self._last_position[:] = position

    def _arm(self, position: Array, host_ns: int) -> None:
        """Drive from the measured pose: nothing jumps."""
        self._law.release()
        pose = np.clip(position, self.hand.limits.low_rad, self.hand.limits.high_rad)
        self._references.latch(pose)
        self._shaper.latch(pose)
        self._last_position[:] = position
        self.safety.arm(host_ns)

    def _drive(
        self, stamp_ns: int, now_ns: int, dt: float, fresh: bool, position: Array, velocity: Array, pressure: Array
    ) -> Tick:
        target, speed, self._limit = self._references.sample(now_ns)
        shaper = self._shaper
        shaper.step(target, speed, self.settings.bandwidth_rad_s, self.settings.max_speed_rad_s, dt)
        out = self._law.tick(shaper.r, shaper.v, self._limit, position, velocity, pressure, dt, fresh)
        return Tick(
            stamp_ns,
            shaper.r,
            position,
            shaper.r - position,
            out[PRESSURE],
            out[TORQUE],
            self._limit,
            out[SATURATED] != 0.0,
            self._no_contact,
        )

    def _vented(self, stamp_ns: int, position: Array, pressure: Array) -> Tick:
        """No pressure; the reference is where the hand is, since nothing is asked of it."""
        zero = np.zeros(len(position))
        out = self._law.tick(position, zero, self._limit, position, zero, pressure, 0.0, False)
        self._law.release()
        return Tick(
            stamp_ns, position, position, zero, zero, out[TORQUE], self._limit, self._no_contact, self._no_contact
        )

    def health(self, host_ns: int) -> list[Health]:
        """Safety state and refused commands."""
        commands = Health("commands", Level.OK, "accepted")
        if self._refusal is not None and (host_ns - self._refusal[0]) * 1e-9 < REFUSAL_S:
            commands = Health("commands", Level.ERROR, self._refusal[1])
        return [self.safety.health(host_ns), commands]
