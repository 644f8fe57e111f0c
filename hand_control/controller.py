"""The controller of one hand: references, safety and the law, composed. No ROS; every time is an argument."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hand_control.arming_ramp import RAMP_PA_PER_S, ArmingRamp
from hand_control.board_watch import BoardWatch
from hand_control.command_check import (
    JointCommand,
    Points,
    check_joint_command,
    check_stop,
    check_torque_command,
    check_trajectory,
    unused_fields,
)
from hand_control.contact_monitor import ContactMonitor, Event
from hand_control.declared import OUT, Settings, U, bounded_dt
from hand_control.found import law_of
from hand_control.frame_checks import (
    FOLLOWING,
    JUMPED,
    NOT_FINITE,
    STUCK_LOW,
    is_suction,
)
from hand_control.frame_watch import NOTHING, Findings, FrameWatch
from hand_control.gaps import Gap
from hand_control.goals import (
    Code,
    GoalLimits,
    GoalRefusedError,
    NamedTolerance,
    RunningGoals,
    TrajectoryGoal,
    check_names_and_age,
    read_tolerances,
)
from hand_control.grasps import Approach, Grasp, Grasping, Outcome
from hand_control.references import References
from hand_control.sensor_lines import angle_jumped, pressure_off
from hand_control.shaping import Shaper, TorqueLimiter, approach_speed, filling_speed
from hand_control.step_watch import LONGEST_S
from hand_control.supervisor import VENT_S, Phase, Supervisor
from hand_control.swings import slowed
from hand_control.tolerance_watch import ToleranceWatch
from hand_control.tuning import gains
from hand_control.unmeasured import Unmeasured
from hand_control.vent_watch import VentWatch
from hand_messages.health import Health, Level
from hand_model.arrays import Array, Flags
from hand_model.description import Hand

REFUSAL_S = 5.0
"""A refused command is shown on diagnostics for this time."""
FILLING = 0.4
"""Share of the ramp's rate that a reference uses while the ramp acts; the rest is left to the feedback."""
FUTURE_S = 0.1
"""A frame stamped further ahead than this comes from another clock."""


class Times(NamedTuple):
    """The times of one message [ns].

    stamp_ns: its stamp, for a frame the acquisition time.  now_ns: the same clock, now.  host_ns: the monotonic clock
    of the host, now; it also runs while a simulated clock is stopped.
    """

    stamp_ns: int
    now_ns: int
    host_ns: int


@dataclass(slots=True, kw_only=True)
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
        """Begin vented. ValueError, one line, where the frames of the hand are too rare to check its sensors."""
        if hand.rate_hz * LONGEST_S < 1.0:
            least_hz = math.ceil(1.0 / LONGEST_S)
            raise ValueError(
                f"board.rate_hz is {hand.rate_hz:g}; the controller checks the sensors from {least_hz} Hz on"
            )
        count = len(hand.joints)
        self.hand = hand
        self.safety = Supervisor()
        self.board = BoardWatch()
        self._unmeasured = Unmeasured(hand, self.board)
        self._ramp = ArmingRamp()
        self._references = References(hand)
        self._law = law_of(hand, settings)
        self._gap = Gap(self._law)
        self._period_s = 1.0 / hand.rate_hz
        self._settling = False
        self._inertia = hand.row("dynamics.inertia_kg_m2") + hand.row("dynamics.coupling_inertia_kg_m2")
        keys = ("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad")
        a0, a1, a2, a3 = (hand.row(f"statics.{key}") for key in keys)
        self._statics = a0, a1, a2, a3
        self._shaper = Shaper(count, self._law.inputs, (hand.limits.low_rad, hand.limits.high_rad))
        self._torque = TorqueLimiter(hand.limits.max_torque_nm)
        self._watch = FrameWatch(hand)
        self._vent_watch = VentWatch(hand)
        self._wanted = self._law.out[OUT.pressure]
        self._sent = self._wanted
        self._liquid = bool(hand.row("hydraulic.share").max() > 0.0)
        self._contact_monitor = ContactMonitor(hand)
        self._tolerance_watch = ToleranceWatch(hand)
        self._stamp_ns: int | None = None
        self._unwatched_s = 0.0
        self._refusal: tuple[int, str] | None = None
        self._remark: tuple[int, str] | None = None
        self._none = np.zeros(count, dtype=np.bool_)
        self._no_pressure = np.zeros(count)
        self._starved = ""
        self._grasp: Grasping | None = None
        self.goals = RunningGoals()
        self.held = False
        self.grasp_end = ""
        self.grasp_contact: Flags = self._none
        self.settings = settings
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Use new settings from the next tick on; the pressures do not jump.

        A new control mode begins at the newest measurement: torque mode from its torque, position mode from its pose.
        """
        switched = settings.control_mode != self.settings.control_mode and self.safety.phase is Phase.ACTIVE
        self.settings = settings
        if switched:
            self.stop_grasp("preempted by a change of control_mode")
            self.goals.end("preempted by a change of control_mode")
            known = self._watch.last_position  # not a number while the hand holds
            self._begin_mode(np.where(np.isfinite(known), known, self._shaper.r))
            if self._torque_mode:
                self._torque.start(self._law.out[OUT.torque])
        self._max_jump_rad = math.radians(settings.max_jump_deg)
        self._tolerant = self._tolerance_watch.configure(settings)
        self._law.change(gains(self.hand, settings))

    def enable(self, on: bool, patient: bool = False) -> None:
        """Drive the hand from its present pose, or vent it. ValueError while a fault is latched.

        patient: see `Supervisor.enable`.
        """
        if on:
            if self.board.fault and not self.safety.fault:
                raise ValueError(f"not enabled: the driver holds the hand vented ({self.board.fault})")
            cause = next(filter(None, map(self.board.evidence, self.hand.joints)), "")
            if cause and not self.safety.fault:
                raise ValueError(f"not enabled: {cause}")
            self.safety.enable(patient)
        else:
            self.vent("disabled on request")

    def vent(self, reason: str) -> None:
        """Vent now, without latching a fault."""
        self.safety.vent(reason)

    def reset(self) -> str:
        """Clear a latched fault; returns it, empty where there was none."""
        return self.safety.reset()

    def command(
        self,
        times: Times,
        names: Sequence[str],
        position: Sequence[float],
        effort: Sequence[float],
        unused: Mapping[str, Sequence[Sequence[float]]] | None = None,
    ) -> None:
        """Follow a joint command (partial lists allowed) of positions [rad] and efforts [N m].

        unused: the other lists of the message by the name of their field; they are checked and reported.
        Raises ValueError, one line, where the whole command is refused.
        """
        check = check_torque_command if self._torque_mode else check_joint_command
        try:
            self._accept()
            checked = check(self.hand, names, position, effort, times.stamp_ns, times.now_ns)
            self._check_unused("joint_commands", names, unused, times.host_ns)
        except ValueError as error:
            self.refuse(str(error), times.host_ns)
            raise
        self.stop_grasp("preempted by joint_commands")
        self.goals.end("preempted by joint_commands", checked.index)
        self._references.command(checked)
        self.safety.command(times.host_ns)

    def trajectory(
        self,
        times: Times,
        names: Sequence[str],
        points: Points,
        unused: Mapping[str, Sequence[Sequence[float]]] | None = None,
    ) -> None:
        """Follow a trajectory of (time [s], positions, velocities); without points, the joints stop.

        unused: as in `command`.  Raises ValueError, one line: it is refused whole.
        """
        stamps = times.stamp_ns, times.now_ns
        try:
            self._accept()
            if not len(points):
                stopped = check_stop(self.hand, names, *stamps)
            elif self._torque_mode:
                raise ValueError("joint_trajectory refused: control_mode is torque")
            else:
                checked = check_trajectory(self.hand, names, points, *stamps)
                self._check_unused("joint_trajectory", names, unused, times.host_ns)
        except ValueError as error:
            self.refuse(str(error), times.host_ns)
            raise
        self.stop_grasp("preempted by joint_trajectory")
        self.goals.end("preempted by another trajectory", checked.index if len(points) else stopped)
        if len(points):
            self._references.trajectory(checked)
        else:
            joints = np.isin(np.arange(len(self.hand.joints)), stopped)
            self._references.hold(self._shaper.stopping_point(self.settings), joints)
        self.safety.command(times.host_ns)

    def follow(
        self,
        times: Times,
        names: Sequence[str],
        points: Points,
        tolerances: tuple[Sequence[NamedTolerance], Sequence[NamedTolerance]],
        goal_time_s: float,
    ) -> TrajectoryGoal:
        """Follow a trajectory as a goal of follow_joint_trajectory, which replaces the goals of its joints.

        tolerances: of the path and of the goal.  goal_time_s: [s], 0 for the setting, negative for no limit.
        Raises GoalRefusedError, one line with its error code; then nothing changes.
        """
        try:
            check_names_and_age(self.hand, names, times.stamp_ns, times.now_ns)
            if not len(points):
                raise GoalRefusedError(Code.INVALID_GOAL, "goal refused: it has no points")
            usual = self.settings.path_tolerance_deg, self.settings.goal_tolerance_deg
            path, goal = (read_tolerances(names, given, deg) for given, deg in zip(tolerances, usual, strict=True))
            self.trajectory(times, names, points)
        except GoalRefusedError as error:
            self.refuse(str(error), times.host_ns)
            raise
        except ValueError as error:
            raise GoalRefusedError(Code.INVALID_GOAL, str(error)) from None
        checked = check_trajectory(self.hand, names, points, times.stamp_ns, times.now_ns)
        allowed_s = goal_time_s or self.settings.goal_time_s
        limits = GoalLimits(path, goal, allowed_s if allowed_s > 0.0 else math.inf)
        made = TrajectoryGoal(self.hand, checked, limits)
        self.goals.add(made)
        return made

    def cancel(self, goal: TrajectoryGoal) -> None:
        """End a goal; its joints stop as fast as their limits allow."""
        if goal.end is None:
            self.goals.end("cancelled on request", goal.index, Code.SUCCESSFUL)
            joints = np.isin(np.arange(len(self.hand.joints)), goal.index)
            self._references.hold(self._shaper.stopping_point(self.settings), joints)

    @property
    def _torque_mode(self) -> bool:
        return self.settings.control_mode == "torque"

    def _check_unused(
        self, topic: str, names: Sequence[str], fields: Mapping[str, Sequence[Sequence[float]]] | None, host_ns: int
    ) -> None:
        """Report given fields that have no effect on diagnostics, for REFUSAL_S. ValueError for broken ones."""
        line = unused_fields(topic, names, fields or {})
        if line:
            self._remark = (host_ns, line)

    def grasp(self, grasp: Grasp, closure: float, max_torque_nm: float, host_ns: int) -> None:
        """Begin a grasp of a closure 0 to 1 [-] from the present reference; a running one is preempted.

        Raises ValueError, one line, where it is refused.
        """
        self._accept()
        if self._torque_mode:
            raise ValueError("control_mode is torque")
        shape, ready = grasp.shape(closure), grasp.preshape(closure)
        speed_rad_s = math.radians(self.settings.grasp_speed_deg_per_s)
        approach = Approach(speed_rad_s, self.settings.grasp_torque_nm, ready, grasp.begins)
        now = self._shaper.r
        # A target within an object, which a joint presses on, would only return to its surface at first.
        start = np.where(shape < now, np.fmin(now, self._watch.last_position), now)
        started = Grasping(self.hand, shape, max_torque_nm, start, approach)
        self.stop_grasp("preempted by another grasp")
        self.goals.end("preempted by a grasp")
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

    @property
    def largest_torque_nm(self) -> float:
        """The largest estimated torque of a joint at the last tick [N m]."""
        return float(np.abs(self._law.out[OUT.torque]).max())

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

        Returns None where the frame is stale, repeated, of another clock or below the range of a pressure sensor for
        less than SUCTION_S; then no command is to be sent.
        """
        dt = 0.0 if self._stamp_ns is None else (times.stamp_ns - self._stamp_ns) * 1e-9
        age_s = (times.now_ns - times.stamp_ns) * 1e-9
        if not -FUTURE_S <= age_s <= VENT_S:
            return None  # stale or from another clock: the supervisor does not count it
        if self._stamp_ns is not None and -1.0 < dt <= 0.0:
            return None  # repeated or out of order
        if self._liquid and is_suction(position, pressure, dt):
            return None
        self._stamp_ns = times.stamp_ns
        if self.held and self.safety.phase is Phase.ACTIVE:
            self.safety.frame(times.host_ns)
            self._unwatched_s += max(dt, 0.0)
            return self._hold(times.stamp_ns, position)
        step_s = bounded_dt(dt)
        # Where the clock was restarted, it is unknown how long ago the last frame was. A hold is a gap.
        elapsed_s = dt + self._unwatched_s if dt >= 0.0 else math.inf
        self._unwatched_s = 0.0
        self._settling = self._gap.before(elapsed_s, self._period_s, position, pressure)
        fresh = self.safety.frame(times.host_ns)
        measured = position, velocity, pressure
        if self.safety.phase is Phase.ACTIVE:
            self._starved = ""
            in_force = self._no_pressure if self.board.vented else self._law.watched
            found = self._watch.check(measured, in_force, self._max_jump_rad, elapsed_s)
            if found is not NOTHING:
                self._react(found, measured, times.host_ns)
        elif self.safety.phase is Phase.ARMING:
            self._first_measurement(measured, times.host_ns, elapsed_s)
        self.safety.check(times.host_ns, self.settings.command_timeout_s)
        if self.safety.phase is not Phase.ACTIVE:
            return self._vented(times.stamp_ns, position, pressure, step_s)
        if self.safety.command_held(times.host_ns, self.settings.command_timeout_s):
            self.stop_grasp("no command for too long")
            self.goals.end("no command for too long")
            self._references.hold(self._shaper.r, ~self._none)
        return self._drive(times, step_s, fresh, (position, velocity), pressure)

    def board_state(self, status: int, protocol: int, fault: str, channels: Sequence[str], host_ns: int) -> None:
        """Take a report of the driver, see `BoardWatch.state`."""
        self.board.state(status, protocol, fault, host_ns, channels)
        self._unmeasured.complete(self.safety, host_ns)

    def check(self, host_ns: int) -> bool:
        """Between frames: whether the hand has just become vented and 0 Pa is to be sent."""
        before = self.safety.phase
        self.safety.check(host_ns, self.settings.command_timeout_s)
        if self.safety.phase is Phase.ACTIVE:
            fault = self.board.check(bool(self._law.out[OUT.pressure].any()), host_ns)
            if fault:
                self.safety.trip(fault)
        return before is Phase.ACTIVE and self.safety.phase is Phase.VENTED

    def _first_measurement(self, measured: tuple[Array, Array, Array], host_ns: int, elapsed_s: float) -> None:
        """Arm on the first plausible measurement, elapsed_s [s] after the last one."""
        verdict, worst = self._watch.plausible(*measured, self._max_jump_rad, elapsed_s)
        if verdict != NOT_FINITE:
            self._arm(*measured, host_ns)
        else:
            self.safety.lacks = self._unmeasured.line(worst, measured)

    def _react(self, found: Findings, measured: tuple[Array, Array, Array], host_ns: int) -> None:
        """Trip on what a frame shows, or warn of a pressure that is too low."""
        position, _, pressure = measured
        worst, last = found.implausible_joint, self._watch.last_position
        if found.plausible == NOT_FINITE:
            self._unmeasured.trip(self.safety, worst, measured, host_ns)
        elif found.plausible == JUMPED:
            channel = int(self.hand.sensors.angle_channel[worst])
            self.safety.trip(angle_jumped(self.hand.joints[worst], channel, position[worst] - last[worst]))
            last[:] = position
        if found.pressure != FOLLOWING:
            self._pressure_off(found.pressure, found.pressure_joint, pressure[found.pressure_joint])
        if found.contradiction is not None:
            self.safety.trip(self._watch.sensors.line(found.contradiction))

    def _pressure_off(self, verdict: int, joint: int, pressure_pa: float) -> None:
        channel, limit_pa = self.hand.sensors.pressure_channel[joint], self.hand.limits.max_pressure_pa[joint]
        line = pressure_off(verdict, self.hand.joints[joint], int(channel), pressure_pa, float(limit_pa))
        if verdict == STUCK_LOW:
            self._starved = line
        else:
            self.safety.trip(line)

    def _arm(self, position: Array, velocity: Array, pressure: Array, host_ns: int) -> None:
        """Drive from the measured pose, so that nothing jumps."""
        self._law.release()
        self._law.out[OUT.pressure] = 0.0
        self._sent = self._law.out[OUT.pressure]
        self._law.restart(position, pressure)
        self._watch.start(position, velocity, pressure)
        self._begin_mode(position)
        if self._torque_mode:
            zero = np.zeros(len(position))
            torque = self._law.tick(np.array([position, zero, zero, zero, position, pressure]), 0.0, False, False)
            self._torque.start(torque[OUT.torque])
        else:
            self._torque.start(self.hand.limits.max_torque_nm)
        self._ramp.start(pressure)
        self._vent_watch.forget()
        self.board.start(host_ns)
        self.safety.arm(host_ns)

    def _begin_mode(self, position: Array) -> None:
        """Hold the measured pose (n,) [rad], without a command and in the present control mode."""
        self._references.latch_in_mode(self._torque_mode, position)
        self._shaper.latch(position)

    def _hold(self, stamp_ns: int, position: Array) -> Tick:
        """Repeat the last pressures: the measurement or the command may be another's, so neither is used."""
        self._watch.last_position.fill(math.nan)
        self.stop_grasp("the hand holds: a topic has a second publisher")
        self.goals.end("the hand holds: a topic has a second publisher")
        reference, out = self._shaper.r, self._law.out
        self._references.hold(reference, ~self._none)
        error, saturated = reference - position, out[OUT.saturated] != 0.0
        return Tick(
            stamp_ns=stamp_ns,
            reference=reference,
            position=position,
            error=error,
            pressure_command=self._sent,
            torque_estimate=out[OUT.torque],
            torque_limit=self._torque.now,
            saturated=saturated,
            contact=self._none,
        )

    def _drive(self, times: Times, dt: float, fresh: bool, measured: tuple[Array, Array], pressure: Array) -> Tick:
        position, _ = measured
        if self._grasp is not None:
            self._follow_grasp(self._grasp, position, dt, times.host_ns)
        target, speed, torque = self._references.sample(times.now_ns)
        for index in self.goals.step(times.now_ns, (target, speed), measured):
            self._references.hold(position, np.isin(np.arange(len(position)), index))
        self._torque.step(torque, self.settings.max_torque_rate_nm_per_s, dt, self._torque_mode)
        if self._torque_mode:
            self._shaper.latch(position)  # the angle is free: the reference follows it
        elif not self._watch.limits:  # the reference waits for a joint that is held back
            flexing = approach_speed(self._inertia, self._torque.now, self.settings)
            if self._ramp.active:  # the reference rises as the pressure may, so that no error grows meanwhile
                flexing = np.minimum(flexing, filling_speed(self._statics, self._shaper.r, FILLING * RAMP_PA_PER_S))
            self._shaper.step(target, speed, self.settings, dt, flexing)
        inputs = self._law.inputs
        inputs[U.limit], inputs[U.position], inputs[U.pressure] = self._torque.now, position, pressure
        if self.board.vented:  # the driver, too, lets the pressure rise from here only, at the same rate
            self._ramp.start(pressure)
        limited = self._settling or self._ramp.active or self._watch.limits
        out = self._law.tick(inputs, dt, fresh and not limited, frozen=self._watch.pressures.short > 0.0)
        self._ramp.limit(self._wanted, dt)
        if self._settling:
            self._gap.after()
        self._watch.hold(self._wanted)
        self._sent = self._law.set_points()
        self._contact_monitor.update(times.stamp_ns, out[OUT.contact], out[OUT.contact_age], out[OUT.contact_torque])
        error = self._shaper.r - position
        if self._tolerant:
            self._check_tolerance(error, position, dt, times.host_ns)
        return Tick(
            stamp_ns=times.stamp_ns,
            reference=self._shaper.r,
            position=position,
            error=error,
            pressure_command=self._sent,
            torque_estimate=out[OUT.torque],
            torque_limit=self._torque.now,
            saturated=out[OUT.saturated] != 0.0,
            contact=self._contact_monitor.contact,
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
            self.goals.end(line, np.flatnonzero(on_path | at_goal), Code.PATH_TOLERANCE_VIOLATED)
            self.refuse(line, host_ns)

    def _vented(self, stamp_ns: int, position: Array, pressure: Array, dt: float) -> Tick:
        """Command no pressure; the reference is the measured pose, since nothing is commanded."""
        zero = np.zeros(len(position))
        reason = f"the hand was vented: {self.safety.fault or self.safety.reason or 'not enabled'}"
        self.stop_grasp(reason)
        self.goals.end(reason)
        self._law.release()
        inputs = np.array([position, zero, zero, zero, position, pressure])
        out = self._law.tick(inputs, dt, False, False)
        self._contact_monitor.release()
        self._vent_watch.frame(position, pressure, dt)
        return Tick(
            stamp_ns=stamp_ns,
            reference=position,
            position=position,
            error=zero,
            pressure_command=zero,
            torque_estimate=out[OUT.torque],
            torque_limit=self._torque.now,
            saturated=self._none,
            contact=self._none,
        )

    def health(self, host_ns: int) -> list[Health]:
        """State of the safety, the commands and the valves."""
        commands = Health("commands", Level.OK, "accepted")
        if self._remark is not None and (host_ns - self._remark[0]) * 1e-9 < REFUSAL_S:
            commands = Health("commands", Level.WARN, self._remark[1])
        if self._refusal is not None and (host_ns - self._refusal[0]) * 1e-9 < REFUSAL_S:
            commands = Health("commands", Level.ERROR, self._refusal[1])
        return [self.safety.health(host_ns), commands, self._valve_health(), self._sensor_health(), self.board.health()]

    def _valve_health(self) -> Health:
        if self._vent_watch.line:
            return Health("valves", Level.ERROR, self._vent_watch.line)
        line = self._starved or slowed(self.hand.joints, self._law.state)
        return Health("valves", Level.WARN if line else Level.OK, line or "following")

    def _sensor_health(self) -> Health:
        watch = self._watch.sensors
        if self.safety.phase is not Phase.ACTIVE:
            return Health("sensors", Level.OK, "not checked: not controlling")
        if watch.unchecked:
            return Health("sensors", Level.WARN, f"sensors not checked: {watch.unchecked}")
        if watch.checked_less:
            line = f"sensors checked less: {watch.checked_less}; the set-points rise slowly"
            return Health("sensors", Level.WARN, line)
        return Health("sensors", Level.OK, "checked")
