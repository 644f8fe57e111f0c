"""The controller of one hand: references, safety and the law, composed. No ROS; every time is an argument."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hand_control.command_check import JointCommand, check_joint_command, check_trajectory
from hand_control.grasping import Approach, Grasping, Outcome
from hand_control.grasps import Grasp
from hand_control.law import CONTACT, CONTACT_AGE, CONTACT_TORQUE, PRESSURE, SATURATED, TORQUE, Law
from hand_control.plausibility import JUMPED, NOT_FINITE, implausible
from hand_control.pressure_watch import FINE, OVER_PRESSURE, STUCK_HIGH, PressureWatch
from hand_control.references import References
from hand_control.settings import Settings
from hand_control.shaping import Shaper
from hand_control.supervisor import VENT_S, Phase, Supervisor
from hand_control.tolerance import Tolerance
from hand_control.touch import Event, Touch
from hand_control.tuning import gains
from hand_messages.health import Health, Level
from hand_model.arrays import Array, Flags
from hand_model.description import Hand

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
    saturated: Flags
    contact: Flags


class Controller:
    """Turns measurements and commands into valve pressures, and vents when in doubt."""

    def __init__(self, hand: Hand, settings: Settings) -> None:
        """Begin vented."""
        count = len(hand.joints)
        self.hand = hand
        self.safety = Supervisor()
        self._references = References(hand)
        self._shaper = Shaper(count)
        self._law = Law(gains(hand, settings))
        self._watch = PressureWatch(hand)
        self._touch = Touch(hand)
        self._tolerance = Tolerance(hand)
        self._last_position = np.full(count, np.nan)
        self._stamp_ns: int | None = None
        self._refusal: tuple[int, str] | None = None
        self._nothing = np.zeros(count, dtype=np.bool_)
        self._starved = ""
        self._grasp: Grasping | None = None
        self.grasp_end = ""
        self.grasp_contact: Flags = self._nothing
        self._limit = hand.limits.max_torque_nm.copy()
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Take over settings; the law sees to it that nothing jumps."""
        self.settings = settings
        self._law.change(gains(self.hand, settings))

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
            self.refuse(str(error), host_ns)
            raise
        self.stop_grasp("preempted by joint_commands")
        self._references.command(checked)
        self.safety.command(host_ns)

    def grasp(self, grasp: Grasp, closure: float, max_torque_nm: float, host_ns: int) -> None:
        """Begin a grasp from the present reference; a running one is preempted. ValueError: refused, one line."""
        self._accept()
        approach = Approach(self.settings.grasp_speed_rad_s, self.settings.grasp_torque_nm)
        started = Grasping(self.hand, grasp, closure, max_torque_nm, self._shaper.r, approach)
        self.stop_grasp("preempted by another grasp")
        self._grasp, self.grasp_end = started, ""
        self.safety.command(host_ns)

    def stop_grasp(self, reason: str) -> None:
        """End a running grasp for a reason; its joints stay at their reference."""
        if self._grasp is not None:
            self._grasp, self.grasp_end = None, reason

    @property
    def grasping(self) -> Grasping | None:
        """The running grasp, or None; `grasp_end` then says why the last one ended."""
        return self._grasp

    def forces(self, stamp_ns: int, force_n: Array) -> None:
        """Readings of the force sites, (sites,) [N] in the description's order."""
        if self.settings.force_sensors:
            self._touch.forces(stamp_ns, force_n, self.settings.contact_force_n)

    def contacts(self) -> list[Event]:
        """Contacts that began or ended since the last call."""
        return self._touch.take()

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
            self.refuse(str(error), host_ns)
            raise
        self.stop_grasp("preempted by joint_trajectory")
        self._references.trajectory(checked)
        self.safety.command(host_ns)

    def _accept(self) -> None:
        if self.safety.phase is not Phase.ACTIVE:
            reason = self.safety.fault or self.safety.reason or self.safety.phase.value
            raise ValueError(f"command refused: the hand is not being controlled ({reason})")

    def refuse(self, line: str, host_ns: int) -> None:
        """Show a refused command on diagnostics for a while."""
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
        step_s = min(max(dt, 0.0), MAX_DT_S)
        fresh = self.safety.frame(host_ns)
        if self.safety.phase is not Phase.VENTED:
            self._judge(position, velocity, pressure, host_ns, step_s)
        self.safety.check(host_ns, self.settings.command_timeout_s)
        if self.safety.phase is not Phase.ACTIVE:
            return self._vented(stamp_ns, position, pressure, step_s)
        if self.safety.command_held(host_ns, self.settings.command_timeout_s):
            self.stop_grasp("no command for too long")
            self._references.latch(self._shaper.r)
        return self._drive(stamp_ns, now_ns, step_s, fresh, position, pressure, host_ns)

    def check(self, host_ns: int) -> bool:
        """Between frames: whether the hand has just become vented and a vent is to be sent."""
        before = self.safety.phase
        self.safety.check(host_ns, self.settings.command_timeout_s)
        return before is Phase.ACTIVE and self.safety.phase is Phase.VENTED

    def _judge(self, position: Array, velocity: Array, pressure: Array, host_ns: int, dt: float) -> None:
        """Trip on what cannot be; arm on the first measurement that can."""
        verdict, worst = implausible(position, velocity, pressure, self._last_position, self.settings.max_jump_rad)
        if verdict == NOT_FINITE:
            if self.safety.phase is Phase.ACTIVE:
                self.safety.trip(f"{self.hand.joints[worst]}: the measurement is not a number")
            return
        if self.safety.phase is Phase.ARMING:
            self._arm(position, pressure, host_ns)
            return
        if verdict == JUMPED:
            jump = math.degrees(abs(position[worst] - self._last_position[worst]))
            self.safety.trip(f"{self.hand.joints[worst]}: angle jumped by {jump:.0f} degrees")
        else:
            self._judge_pressure(pressure, dt)
        self._last_position[:] = position

    def _judge_pressure(self, pressure: Array, dt: float) -> None:
        verdict, worst = self._watch.look(self._law.out[PRESSURE], pressure, dt)
        joint, bar = self.hand.joints[worst], pressure[worst] * 1e-5
        self._starved = ""
        if verdict == OVER_PRESSURE:
            self.safety.trip(f"{joint}: over-pressure, {bar:.2f} bar")
        elif verdict == STUCK_HIGH:
            self.safety.trip(f"{joint}: the valve does not follow, pressure stays at {bar:.2f} bar")
        elif verdict != FINE:
            self._starved = f"{joint}: the valve does not follow, only {bar:.2f} bar; leak, supply or a shut valve"

    def _arm(self, position: Array, pressure: Array, host_ns: int) -> None:
        """Drive from the measured pose: nothing jumps."""
        self._law.release()
        self._law.out[PRESSURE] = 0.0
        self._watch.start(pressure)
        pose = np.clip(position, self.hand.limits.low_rad, self.hand.limits.high_rad)
        self._references.latch(pose)
        self._shaper.latch(pose)
        self._last_position[:] = position
        self.safety.arm(host_ns)

    def _drive(
        self, stamp_ns: int, now_ns: int, dt: float, fresh: bool, position: Array, pressure: Array, host_ns: int
    ) -> Tick:
        if self._grasp is not None:
            self._follow_grasp(self._grasp, position, dt, host_ns)
        target, speed, self._limit = self._references.sample(now_ns)
        shaper = self._shaper
        shaper.step(target, speed, self.settings.bandwidth_rad_s, self.settings.max_speed_rad_s, dt)
        out = self._law.tick(
            shaper.r, shaper.v, shaper.a, self._limit, position, pressure, dt, fresh and not self._starved
        )
        self._touch.update(stamp_ns, out[CONTACT], out[CONTACT_AGE], out[CONTACT_TORQUE])
        error = shaper.r - position
        self._watch_tolerance(error, position, dt, host_ns)
        return Tick(
            stamp_ns,
            shaper.r,
            position,
            error,
            out[PRESSURE],
            out[TORQUE],
            self._limit,
            out[SATURATED] != 0.0,
            self._touch.contact,
        )

    def _follow_grasp(self, grasp: Grasping, position: Array, dt: float, host_ns: int) -> None:
        target, limit = grasp.step(dt, position, self._touch.contact)
        self._references.command(JointCommand(np.arange(len(position)), target, limit))
        self.safety.command(host_ns)
        self.grasp_contact = grasp.contact
        if grasp.outcome is not Outcome.RUNNING:
            self._grasp, self.grasp_end = None, grasp.outcome.value

    def _watch_tolerance(self, error: Array, position: Array, dt: float, host_ns: int) -> None:
        """Abort what a trajectory does to joints that have left their tolerance: they hold where they are."""
        on_path, at_goal = self._references.motion
        line = self._tolerance.look(error, on_path, at_goal, self.settings, dt)
        if line:
            self._references.hold(position, on_path | at_goal)
            self.refuse(line, host_ns)

    def _vented(self, stamp_ns: int, position: Array, pressure: Array, dt: float) -> Tick:
        """No pressure; the reference is where the hand is, since nothing is asked of it."""
        zero = np.zeros(len(position))
        self.stop_grasp(f"the hand was vented: {self.safety.fault or self.safety.reason or 'not enabled'}")
        self._law.release()
        out = self._law.tick(position, zero, zero, self._limit, position, pressure, dt, False, False)
        self._touch.release()
        return Tick(stamp_ns, position, position, zero, zero, out[TORQUE], self._limit, self._nothing, self._nothing)

    def health(self, host_ns: int) -> list[Health]:
        """Safety state and refused commands."""
        commands = Health("commands", Level.OK, "accepted")
        if self._refusal is not None and (host_ns - self._refusal[0]) * 1e-9 < REFUSAL_S:
            commands = Health("commands", Level.ERROR, self._refusal[1])
        valves = Health("valves", Level.WARN if self._starved else Level.OK, self._starved or "following")
        return [self.safety.health(host_ns), commands, valves]
