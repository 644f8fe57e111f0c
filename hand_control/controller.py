"""The controller of one hand: references, safety and the law, composed. No ROS; every time is an argument."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hand_control.command_check import JointCommand, Points, check_joint_command, check_trajectory
from hand_control.contact_monitor import ContactMonitor, Event
from hand_control.declared import OUT, Settings, U
from hand_control.frame_checks import (
    FOLLOWING,
    JUMPED,
    NOT_FINITE,
    OVER_PRESSURE,
    STUCK_HIGH,
    PressureWatch,
    ToleranceWatch,
    implausible,
)
from hand_control.grasps import Approach, Grasp, Grasping, Outcome
from hand_control.law import Law
from hand_control.references import References, Shaper
from hand_control.supervisor import VENT_S, Phase, Supervisor
from hand_control.tuning import gains
from hand_messages.health import Health, Level
from hand_model.arrays import Array, Flags
from hand_model.description import Hand

REFUSAL_S = 5.0
"""A refused command is shown on diagnostics for this time."""
FUTURE_S = 0.1
"""A frame stamped further ahead than this comes from another clock."""
MAX_DT_S = 0.05
"""Upper bound on the dt passed to the control law; a longer gap carries no information about the motion within it."""


class Times(NamedTuple):
    """The times of one message [ns].

    stamp_ns: its stamp, for a frame the acquisition time.  now_ns: the same clock, now.  host_ns: the monotonic clock
    of the host, now; it also runs while a simulated clock is stopped.
    """

    stamp_ns: int
    now_ns: int
    host_ns: int


@dataclass(slots=True)
class Tick:
    """The result of one frame; arrays (n,) in the hand's order, overwritten by the next tick.

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
    """Converts measurements and commands to valve pressures, and vents after every fault."""

    def __init__(self, hand: Hand, settings: Settings) -> None:
        """Begin vented."""
        count = len(hand.joints)
        self.hand = hand
        self.safety = Supervisor()
        self._references = References(hand)
        self._law = Law(gains(hand, settings))
        self._shaper = Shaper(count, self._law.inputs)
        self._pressure_watch = PressureWatch(hand)
        self._contact_monitor = ContactMonitor(hand)
        self._tolerance_watch = ToleranceWatch(hand)
        self._last_position = np.full(count, np.nan)
        self._stamp_ns: int | None = None
        self._refusal: tuple[int, str] | None = None
        self._none = np.zeros(count, dtype=np.bool_)
        self._starved = ""
        self._grasp: Grasping | None = None
        self.grasp_end = ""
        self.grasp_contact: Flags = self._none
        self._limit = hand.limits.max_torque_nm.copy()
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Use new settings from the next tick on; the pressures do not jump."""
        self.settings = settings
        self._max_jump_rad = math.radians(settings.max_jump_deg)
        self._law.change(gains(self.hand, settings))

    def enable(self, on: bool) -> None:
        """Drive the hand from its present pose, or vent it. ValueError while a fault is latched."""
        if on:
            self.safety.enable()
        else:
            self.vent("disabled on request")

    def vent(self, reason: str) -> None:
        """Vent now, without latching a fault."""
        self.safety.vent(reason)

    def reset(self) -> str:
        """Clear a latched fault; returns it, empty where there was none."""
        return self.safety.reset()

    def command(self, times: Times, names: Sequence[str], position: Sequence[float], effort: Sequence[float]) -> None:
        """Follow a joint command (partial lists allowed) of positions [rad] and efforts [N m].

        Raises ValueError, one line, where the whole command is refused.
        """
        try:
            self._accept()
            checked = check_joint_command(self.hand, names, position, effort, times.stamp_ns, times.now_ns)
        except ValueError as error:
            self.refuse(str(error), times.host_ns)
            raise
        self.stop_grasp("preempted by joint_commands")
        self._references.command(checked)
        self.safety.command(times.host_ns)

    def trajectory(self, times: Times, names: Sequence[str], points: Points) -> None:
        """Follow a trajectory of (time [s], positions, velocities). ValueError: it is refused whole, one line."""
        try:
            self._accept()
            checked = check_trajectory(self.hand, names, points, times.stamp_ns, times.now_ns)
        except ValueError as error:
            self.refuse(str(error), times.host_ns)
            raise
        self.stop_grasp("preempted by joint_trajectory")
        self._references.trajectory(checked)
        self.safety.command(times.host_ns)

    def grasp(self, grasp: Grasp, closure: float, max_torque_nm: float, host_ns: int) -> None:
        """Begin a grasp of a closure 0 to 1 [-] from the present reference; a running one is preempted.

        Raises ValueError, one line, where it is refused.
        """
        self._accept()
        approach = Approach(math.radians(self.settings.grasp_speed_deg_per_s), self.settings.grasp_torque_nm)
        started = Grasping(self.hand, grasp.shape(closure), max_torque_nm, self._shaper.r, approach)
        self.stop_grasp("preempted by another grasp")
        self._grasp, self.grasp_end = started, ""
        self.safety.command(host_ns)

    def stop_grasp(self, reason: str) -> None:
        """End a running grasp for a reason; its joints stay at their reference."""
        if self._grasp is not None:
            self._grasp, self.grasp_end = None, reason

    @property
    def grasping(self) -> Grasping | None:
        """The running grasp, or None; `grasp_end` then is the reason why the last one ended."""
        return self._grasp

    def forces(self, stamp_ns: int, force_n: Array) -> None:
        """Take readings of the force sites, (sites,) [N] in the description's order."""
        if self.settings.force_sensors:
            self._contact_monitor.forces(stamp_ns, force_n, self.settings.contact_force_n)

    def contacts(self) -> list[Event]:
        """Contacts that began or ended since the last call."""
        return self._contact_monitor.take()

    def _accept(self) -> None:
        if self.safety.phase is not Phase.ACTIVE:
            reason = self.safety.fault or self.safety.reason or self.safety.phase.value
            raise ValueError(f"command refused: the hand is not being controlled ({reason})")

    def refuse(self, line: str, host_ns: int) -> None:
        """Show a refused command on diagnostics for REFUSAL_S."""
        self._refusal = (host_ns, line)

    def frame(self, times: Times, position: Array, velocity: Array, pressure: Array) -> Tick | None:
        """Process one frame: position [rad], velocity [rad/s] and pressure [Pa], (n,) each in the hand's order.

        Returns None where the frame is stale, repeated or of another clock; then no command is to be sent.
        """
        dt = 0.0 if self._stamp_ns is None else (times.stamp_ns - self._stamp_ns) * 1e-9
        age_s = (times.now_ns - times.stamp_ns) * 1e-9
        if not -FUTURE_S <= age_s <= VENT_S:
            return None  # stale or from another clock: the supervisor does not count it
        if self._stamp_ns is not None and -1.0 < dt <= 0.0:
            return None  # repeated or out of order
        self._stamp_ns = times.stamp_ns
        step_s = min(max(dt, 0.0), MAX_DT_S)
        fresh = self.safety.frame(times.host_ns)
        if self.safety.phase is not Phase.VENTED:
            self._check_measurement(position, velocity, pressure, times.host_ns, step_s)
        self.safety.check(times.host_ns, self.settings.command_timeout_s)
        if self.safety.phase is not Phase.ACTIVE:
            return self._vented(times.stamp_ns, position, pressure, step_s)
        if self.safety.command_held(times.host_ns, self.settings.command_timeout_s):
            self.stop_grasp("no command for too long")
            self._references.latch(self._shaper.r)
        return self._drive(times, step_s, fresh, position, pressure)

    def check(self, host_ns: int) -> bool:
        """Between frames: whether the hand has just become vented and 0 Pa is to be sent."""
        before = self.safety.phase
        self.safety.check(host_ns, self.settings.command_timeout_s)
        return before is Phase.ACTIVE and self.safety.phase is Phase.VENTED

    def _check_measurement(self, position: Array, velocity: Array, pressure: Array, host_ns: int, dt: float) -> None:
        """Trip on an implausible measurement; arm on the first plausible one."""
        verdict, worst = implausible(position, velocity, pressure, self._last_position, self._max_jump_rad)
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
            self._check_pressure(pressure, dt)
        self._last_position[:] = position

    def _check_pressure(self, pressure: Array, dt: float) -> None:
        verdict, worst = self._pressure_watch.check(self._law.out[OUT.pressure], pressure, dt)
        joint, bar = self.hand.joints[worst], pressure[worst] * 1e-5
        self._starved = ""
        if verdict == OVER_PRESSURE:
            self.safety.trip(f"{joint}: over-pressure, {bar:.2f} bar")
        elif verdict == STUCK_HIGH:
            self.safety.trip(f"{joint}: the valve does not follow, the pressure stays at {bar:.2f} bar")
        elif verdict != FOLLOWING:
            self._starved = (
                f"{joint}: the valve does not follow, the pressure is only {bar:.2f} bar;"
                " check for a leak, the supply and a closed valve"
            )

    def _arm(self, position: Array, pressure: Array, host_ns: int) -> None:
        """Drive from the measured pose, so that nothing jumps."""
        self._law.release()
        self._law.out[OUT.pressure] = 0.0
        self._pressure_watch.start(pressure)
        pose = np.clip(position, self.hand.limits.low_rad, self.hand.limits.high_rad)
        self._references.latch(pose)
        self._shaper.latch(pose)
        self._last_position[:] = position
        self.safety.arm(host_ns)

    def _drive(self, times: Times, dt: float, fresh: bool, position: Array, pressure: Array) -> Tick:
        if self._grasp is not None:
            self._follow_grasp(self._grasp, position, dt, times.host_ns)
        target, speed, self._limit = self._references.sample(times.now_ns)
        self._shaper.step(target, speed, self.settings, dt)
        inputs = self._law.inputs
        inputs[U.limit], inputs[U.position], inputs[U.pressure] = self._limit, position, pressure
        out = self._law.tick(inputs, dt, fresh and not self._starved)
        self._contact_monitor.update(times.stamp_ns, out[OUT.contact], out[OUT.contact_age], out[OUT.contact_torque])
        error = self._shaper.r - position
        self._check_tolerance(error, position, dt, times.host_ns)
        return Tick(
            times.stamp_ns,
            self._shaper.r,
            position,
            error,
            out[OUT.pressure],
            out[OUT.torque],
            self._limit,
            out[OUT.saturated] != 0.0,
            self._contact_monitor.contact,
        )

    def _follow_grasp(self, grasp: Grasping, position: Array, dt: float, host_ns: int) -> None:
        target, limit = grasp.step(dt, position, self._contact_monitor.contact)
        self._references.command(JointCommand(np.arange(len(position)), target, limit))
        self.safety.command(host_ns)
        self.grasp_contact = grasp.contact
        if grasp.outcome is not Outcome.RUNNING:
            self._grasp, self.grasp_end = None, grasp.outcome.value

    def _check_tolerance(self, error: Array, position: Array, dt: float, host_ns: int) -> None:
        """End the trajectories where a joint has left its tolerance; their joints hold the measured angle."""
        on_path, at_goal = self._references.motion
        line = self._tolerance_watch.check(error, on_path, at_goal, self.settings, dt)
        if line:
            self._references.hold(position, on_path | at_goal)
            self.refuse(line, host_ns)

    def _vented(self, stamp_ns: int, position: Array, pressure: Array, dt: float) -> Tick:
        """Command no pressure; the reference is the measured pose, since nothing is commanded."""
        zero = np.zeros(len(position))
        self.stop_grasp(f"the hand was vented: {self.safety.fault or self.safety.reason or 'not enabled'}")
        self._law.release()
        inputs = np.array([position, zero, zero, self._limit, position, pressure])
        out = self._law.tick(inputs, dt, False, False)
        self._contact_monitor.release()
        return Tick(stamp_ns, position, position, zero, zero, out[OUT.torque], self._limit, self._none, self._none)

    def health(self, host_ns: int) -> list[Health]:
        """State of the safety, the commands and the valves."""
        commands = Health("commands", Level.OK, "accepted")
        if self._refusal is not None and (host_ns - self._refusal[0]) * 1e-9 < REFUSAL_S:
            commands = Health("commands", Level.ERROR, self._refusal[1])
        valves = Health("valves", Level.WARN if self._starved else Level.OK, self._starved or "following")
        return [self.safety.health(host_ns), commands, valves]
