"""The controller node: joint states and pressures in, valve commands out. The only rclpy module here."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from hand_msgs.action import Grasp
from hand_msgs.msg import BoardState, Contact, ContactForces, ControllerState, JointPressures, ValveCommand
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

from hand_control.command_inputs import CommandInputs
from hand_control.controller import Controller, Tick, Times
from hand_control.declared import PARAMETERS, Settings
from hand_control.goals import Code, GoalRefusedError, TrajectoryGoal, check_fields, check_size
from hand_control.grasps import Grasp as Pattern
from hand_control.grasps import Outcome, load_grasps
from hand_control.inputs import JointInput
from hand_control.object_width import object_width_m
from hand_control.supervisor import FREEZE_S, Phase
from hand_control.warm_up import warm_up
from hand_messages.bounds import check_bytes, shown
from hand_messages.cdr import Layout
from hand_messages.health import Health, Level
from hand_messages.layouts import CONTACT_FORCES, CONTROLLER_STATE, JOINT_PRESSURES, JOINT_STATE, VALVE_COMMAND
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.geometry import palm_frame
from hand_ros.heartbeat import Heartbeat
from hand_ros.node import (
    COMMAND_QOS,
    EVENT_QOS,
    LIVE_QOS,
    QUEUED_QOS,
    RARELY_S,
    RELIABLE_SENSOR_QOS,
    STATE_QOS,
    HandNode,
    default_config,
    end,
    run,
)
from hand_ros.publishers import Verdict

try:
    from control_msgs.action import FollowJointTrajectory, GripperCommand
except ImportError:  # not installed: the hand then has the action `grasp` alone
    FollowJointTrajectory = GripperCommand = None

WATCH_PERIOD_S = 0.02
"""Largest delay until silence is detected; the board also vents when the lifetime of its set-points ends."""
FEEDBACK_HZ = 20.0
CANCELLED, DONE = "cancelled", Outcome.DONE.value


class ControllerNode(HandNode):
    """Runs the controller once per joint state; a timer detects silence."""

    def __init__(self) -> None:
        """Declare parameters."""
        super().__init__("controller", PARAMETERS)
        self._ends: dict[bytes, Future] = {}
        self._interfaces: list[Callable[[], object]] = []

    def configure(self, values: dict[str, Any]) -> None:
        """Load the description, check the settings, create publishers, subscriptions and services."""
        self._hand: Hand = load_hand(values["hand_description"] or default_config("hand.yaml"), values["joint_prefix"])
        self._settings = Settings.of(self._hand, values)
        self._enabled_at_start = values["enabled_at_start"]
        self._grasps = load_grasps(Path(values["grasps"] or default_config("grasps.yaml")), self._hand)
        self._controller = Controller(self._hand, self._settings)
        self._heartbeat = Heartbeat(self._settings.heartbeat_timeout_s)
        if before := self.load_fault(values["state_file"]):
            self._controller.safety.trip(before)
        joints, frame_id = self._hand.joints, self.frame_id(values, palm_frame(self._hand, self.get_namespace()))
        self._states_in = JointInput(JOINT_STATE, joints, ("position", "velocity"))
        self._forces_in = JointInput(CONTACT_FORCES, self._hand.sensors.sites, ("force",))
        self._pressures_in = JointInput(JOINT_PRESSURES, joints, ("pressure",))
        self._commands_in = CommandInputs(len(joints))
        self._command_out = Layout(VALVE_COMMAND, frame_id, joints)
        self._state_out = Layout(CONTROLLER_STATE, frame_id, joints)
        self._state_out_frame = frame_id
        self._position = np.zeros(len(joints))
        self._input_fault = ""
        warm_up(self._hand, self._settings)
        self._create_interfaces()

    def _create_interfaces(self) -> None:
        self._command_publisher = self.sole_publisher(ValveCommand, "valve_command", COMMAND_QOS)
        self._state_publisher = self.create_publisher(ControllerState, "controller_state", RELIABLE_SENSOR_QOS)
        subscriptions = (
            self.sole_source(JointPressures, "pressures", self._on_pressures, STATE_QOS, self._on_publishers),
            self.sole_source(JointState, "joint_states", self._on_joint_states, STATE_QOS, self._on_publishers),
            self.create_subscription(ContactForces, "contact_forces", self._on_forces, STATE_QOS, raw=True),
            self.create_subscription(JointState, "joint_commands", self._on_raw_command, QUEUED_QOS, raw=True),
            self.create_subscription(
                JointTrajectory, "joint_trajectory", self._on_raw_trajectory, QUEUED_QOS, raw=True
            ),
            self.sole_source(BoardState, "board_state", self._on_board_state, STATE_QOS, self._on_publishers),
            self.create_subscription(Empty, "heartbeat", self._on_heartbeat, LIVE_QOS, raw=True),
        )
        services = (
            self.create_service(Trigger, "vent", self._on_vent),
            self.create_service(Trigger, "reset", self._on_reset),
            self.create_service(SetBool, "enable", self._on_enable),
        )
        self._contact_publisher = self.create_publisher(Contact, "contacts", EVENT_QOS)
        actions = [self._action(Grasp, "grasp", self._on_goal, self._on_accepted)]
        if FollowJointTrajectory is not None:
            actions += [
                self._action(
                    FollowJointTrajectory, "follow_joint_trajectory", self._on_follow, self._on_follow_accepted
                ),
                self._action(GripperCommand, "gripper_cmd", self._on_gripper, self._on_accepted),
            ]
        self._interfaces = [
            self.listen_to_stop(self._on_stop, lambda: bool(self._controller.safety.fault)),
            *(action.destroy for action in actions),
            lambda: self.destroy_publisher(self._contact_publisher),
            lambda: self.destroy_publisher(self._command_publisher),
            lambda: self.destroy_publisher(self._state_publisher),
            *(lambda s=s: self.destroy_subscription(s) for s in subscriptions),  # type: ignore[misc]
            *(lambda s=s: self.destroy_service(s) for s in services),  # type: ignore[misc]
        ]

    def _action(self, kind: Any, name: str, on_goal: Any, on_accepted: Any) -> ActionServer:
        """The server of an action; each of its goals has an end of its own."""
        return ActionServer(
            self,
            kind,
            name,
            self._run,
            goal_callback=on_goal,
            handle_accepted_callback=on_accepted,
            cancel_callback=self._on_cancel,
        )

    def reconfigure(self, values: dict[str, Any]) -> None:
        """Use new gains and limits, all or none, without a jump."""
        self._controller.configure(Settings.of(self._hand, values))

    def latched_fault(self) -> str:
        """The latched fault of the controller; empty for none."""
        return self._controller.safety.fault

    def described(self) -> str:
        """The node and how many joints it has."""
        return f"{self.get_name()} of {len(self._hand.joints)} joints"

    def start(self) -> None:
        """Begin to control from the present pose of the hand."""
        self.cycles = 0
        self._pressure: Array = np.full(len(self._hand.joints), np.nan)
        self._pressure_ns = 0
        if self._enabled_at_start and not self._controller.safety.fault:
            self._controller.enable(True, patient=True)
        self._waited = False
        self._grasp_handle: ServerGoalHandle | None = None
        self._pattern: Pattern | None = None
        self._followed: list[tuple[ServerGoalHandle, TrajectoryGoal]] = []
        self._feedback_ns = 0
        self._watch = self.create_timer(WATCH_PERIOD_S, self._on_watch)

    def stop(self) -> None:
        """Vent and log it; the last command is dropped."""
        self.destroy_timer(self._watch)
        self._controller.vent("the controller was deactivated")
        self._controller.stop_grasp("the controller was deactivated")
        self._controller.goals.end("the controller was deactivated")
        self._watch_goals()
        self._send_vent()
        self.get_logger().info("vented: the controller was deactivated")

    def release(self) -> None:
        """Destroy publishers, subscriptions and services."""
        for destroy in self._interfaces:
            destroy()
        self._interfaces = []

    def _now_ns(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _on_pressures(self, raw: bytes) -> None:
        try:
            self._pressure_ns, (self._pressure,) = self._pressures_in.read(raw)
        except ValueError as error:
            self._input_problem(f"pressures: {error}")

    def _on_joint_states(self, raw: bytes) -> None:
        if not self.active:
            return
        host_ns = time.monotonic_ns()
        try:
            stamp_ns, (position, velocity) = self._states_in.read(raw)
        except ValueError as error:
            self._input_problem(f"joint_states: {error}")
            return
        if abs(stamp_ns - self._pressure_ns) > FREEZE_S * 1e9:
            return  # no pressures of the same time: not a usable frame, and silence vents
        self._position = position
        times = Times(stamp_ns, self._now_ns(), host_ns)
        tick = self._controller.frame(times, position, velocity, self._pressure)
        if tick is not None:
            self.cycles = (self.cycles or 0) + 1
            self._publish(tick)
            self._publish_contacts()
            self._watch_goals(tick)
        self.keep_fault(self._controller.safety.fault)  # after the vent is sent: a disk may be slow
        self._input_fault = ""

    def _on_board_state(self, raw: bytes) -> None:
        try:
            check_bytes(len(raw))
            state = deserialize_message(raw, BoardState)
        except (ValueError, RuntimeError) as error:  # rclpy raises a RuntimeError for bytes that it cannot decode
            self._input_problem(f"board_state: {error}")
            return
        self._controller.board_state(
            state.status, state.protocol, state.fault, state.channel_fault, time.monotonic_ns()
        )
        if self.active:
            self._on_watch()

    def _input_problem(self, line: str) -> None:
        """Report input that cannot be used. It is not a frame, so that lasting bad input vents as silence does."""
        self._input_fault = line
        self.log_throttled(Level.ERROR, "input", line)

    def _publish(self, tick: Tick) -> None:
        lifetime_ns = round(self._controller.settings.command_lifetime_s * 1e9)
        self._command_publisher.publish(
            self._command_out.encode(tick.stamp_ns, lifetime_ns=lifetime_ns, pressure=tick.pressure_command)
        )
        self._state_publisher.publish(
            self._state_out.encode(
                tick.stamp_ns,
                reference=tick.reference,
                position=tick.position,
                error=tick.error,
                pressure_command=tick.pressure_command,
                torque_estimate=tick.torque_estimate,
                torque_limit=tick.torque_limit,
                saturated=tick.saturated,
                contact=tick.contact,
            )
        )

    def _on_forces(self, raw: bytes) -> None:
        if not self._commands_in.take("contact_forces", time.monotonic()):
            return
        try:
            stamp_ns, (force,) = self._forces_in.read(raw)
        except ValueError as error:
            self._input_problem(f"contact_forces: {error}")
            return
        self._controller.forces(stamp_ns, force)

    def _publish_contacts(self) -> None:
        for event in self._controller.contacts():
            message = Contact(
                name=self._hand.joints[event.joint],
                touching=event.touching,
                torque=event.torque_nm,
                force=event.force_n,
                source=event.source,
                delay=event.delay_s,
            )
            message.header.frame_id = self._state_out_frame
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(event.onset_ns, 1_000_000_000)
            self._contact_publisher.publish(message)

    def _on_goal(self, goal: Grasp.Goal) -> GoalResponse:
        """Accept or refuse a grasp; an accepted one begins at once and preempts a running one."""
        return self._begin_grasp("grasp", goal.pattern, goal.closure, goal.max_torque)

    def _on_gripper(self, goal: Any) -> GoalResponse:
        """Accept or refuse a goal of gripper_cmd: closure 0 to 1 of the pattern that is set, largest torque [N m]."""
        command = goal.command
        pattern = self._settings.gripper_pattern
        return self._begin_grasp("gripper_cmd", pattern, command.position, command.max_effort)

    def _begin_grasp(self, action: str, name: str, closure: float, max_torque: float) -> GoalResponse:
        try:
            if not self.active:
                raise ValueError("the controller is not active")
            if not self._commands_in.take(action, time.monotonic()):
                return GoalResponse.REJECT
            if name not in self._grasps:
                raise ValueError(f"pattern is {shown(name)}; it must be one of {', '.join(self._grasps)}")
            pattern = self._grasps[name]
            self._controller.grasp(pattern, closure, max_torque, time.monotonic_ns())
        except ValueError as error:
            line = f"{action} refused: {error}"
            self.log_throttled(Level.ERROR, action, line)
            self._controller.refuse(line, time.monotonic_ns())
            return GoalResponse.REJECT
        self._end_grasp("preempted by another grasp")
        self._pattern = pattern
        return GoalResponse.ACCEPT

    def _on_accepted(self, handle: ServerGoalHandle) -> None:
        """Begin the goal that was accepted last; each goal has an end of its own, also when many come in succession."""
        self._ends[bytes(handle.goal_id.uuid)] = Future()
        self._grasp_handle = handle
        handle.execute()

    def _on_cancel(self, _handle: ServerGoalHandle) -> CancelResponse:
        return CancelResponse.ACCEPT

    def _end_grasp(self, reason: str) -> None:
        """End the goal of the running grasp, where there is one, with its contacts and angles of now."""
        handle, self._grasp_handle = self._grasp_handle, None
        if handle is None:
            return
        contact = self._controller.grasp_contact.tolist()
        if isinstance(handle.request, Grasp.Goal):
            width_m = object_width_m(self._hand, self._position, self._controller.grasp_contact)
            held = f"{sum(contact)} joints are in contact"
            if math.isfinite(width_m):
                held += f"; the object is about {1e3 * width_m:.0f} mm wide there"
            result = Grasp.Result(
                success=reason == DONE,
                message=held if reason == DONE else reason,
                name=list(self._hand.joints),
                contact=contact,
                position=self._position.tolist(),
                object_width=width_m,
            )
        else:
            values = self._gripper_values(any(contact))
            result = GripperCommand.Result(**values, reached_goal=reason == DONE and not values["stalled"])
        self._set_end(handle, "canceled" if reason == CANCELLED else "succeed" if reason == DONE else "abort", result)

    def _gripper_values(self, stalled: bool) -> dict[str, Any]:
        """What feedback and result of gripper_cmd have in common: closure, largest torque [N m], contact."""
        closure = self._pattern.closure(self._position) if self._pattern is not None else 0.0
        return {"position": closure, "effort": self._controller.largest_torque_nm, "stalled": stalled}

    def _set_end(self, handle: ServerGoalHandle, how: str, result: Any) -> None:
        self._ends[bytes(handle.goal_id.uuid)].set_result((how, result))

    async def _run(self, handle: ServerGoalHandle) -> Any:
        """Wait for the end of a goal, of any action; how: the name of the method of the handle that ends it."""
        goal = bytes(handle.goal_id.uuid)
        how, result = await self._ends[goal]
        del self._ends[goal]
        getattr(handle, how)()
        return result

    def _on_follow(self, _goal: Any) -> GoalResponse:
        """Accept every goal of an active controller: what is wrong is then a result with code and reason."""
        taken = self.active and self._commands_in.take("follow_joint_trajectory", time.monotonic())
        return GoalResponse.ACCEPT if taken else GoalResponse.REJECT

    def _on_follow_accepted(self, handle: ServerGoalHandle) -> None:
        goal, trajectory = handle.request, handle.request.trajectory
        self._ends[bytes(handle.goal_id.uuid)] = Future()
        tolerances = goal.path_tolerance, goal.goal_tolerance
        other = {
            "multi_dof_trajectory": goal.multi_dof_trajectory.joint_names,
            "component_path_tolerance": goal.component_path_tolerance,
            "component_goal_tolerance": goal.component_goal_tolerance,
        }
        try:
            check_size(len(trajectory.points))
            check_fields(other)
            points = [(_seconds(p.time_from_start), p.positions, p.velocities) for p in trajectory.points]
            made = self._controller.follow(
                self._times(trajectory), trajectory.joint_names, points, tolerances, _seconds(goal.goal_time_tolerance)
            )
        except GoalRefusedError as error:
            self.log_throttled(Level.ERROR, "follow_joint_trajectory", str(error))
            self._end_follow(handle, error.code, str(error))
        else:
            self._followed.append((handle, made))
        handle.execute()

    def _end_follow(self, handle: ServerGoalHandle, code: Code, line: str) -> None:
        how = "canceled" if handle.is_cancel_requested else "succeed" if code is Code.SUCCESSFUL else "abort"
        self._set_end(handle, how, FollowJointTrajectory.Result(error_code=int(code), error_string=line))

    def _watch_goals(self, tick: Tick | None = None) -> None:
        """Publish feedback of running goals at FEEDBACK_HZ, and their ends where they have ended or are cancelled."""
        report = tick is not None and tick.stamp_ns - self._feedback_ns > 1e9 / FEEDBACK_HZ
        if tick is not None and report:
            self._feedback_ns = tick.stamp_ns
        self._watch_follow(tick if report else None)
        self._watch_grasp(tick if report else None)

    def _watch_follow(self, tick: Tick | None = None) -> None:
        for handle, goal in self._followed:
            if handle.is_cancel_requested:
                self._controller.cancel(goal)
            if goal.end is not None:
                self._end_follow(handle, *goal.end)
            elif tick is not None:
                handle.publish_feedback(self._follow_feedback(goal, tick))
        self._followed = [(handle, goal) for handle, goal in self._followed if goal.end is None]

    def _follow_feedback(self, goal: TrajectoryGoal, tick: Tick) -> Any:
        feedback = FollowJointTrajectory.Feedback(joint_names=[self._hand.joints[index] for index in goal.index])
        feedback.header.frame_id = self._state_out_frame
        feedback.header.stamp.sec, feedback.header.stamp.nanosec = divmod(tick.stamp_ns, 1_000_000_000)
        actual = tick.position[goal.index]
        feedback.desired.positions = goal.desired_rad.tolist()
        feedback.actual.positions = actual.tolist()
        feedback.error.positions = (goal.desired_rad - actual).tolist()
        for point in (feedback.desired, feedback.actual, feedback.error):
            seconds = max(tick.stamp_ns - goal.start_ns, 0)
            point.time_from_start.sec, point.time_from_start.nanosec = divmod(seconds, 1_000_000_000)
        return feedback

    def _watch_grasp(self, tick: Tick | None = None) -> None:
        handle = self._grasp_handle
        if handle is None:
            return
        if handle.is_cancel_requested:
            self._controller.stop_grasp(CANCELLED)
        grasp = self._controller.grasping
        if grasp is None:
            self._end_grasp(self._controller.grasp_end)
        elif tick is not None and isinstance(handle.request, Grasp.Goal):
            handle.publish_feedback(
                Grasp.Feedback(
                    name=list(self._hand.joints),
                    contact=grasp.contact.tolist(),
                    torque=tick.torque_estimate.tolist(),
                    progress=grasp.progress,
                    object_width=object_width_m(self._hand, self._position, grasp.contact),
                )
            )
        elif tick is not None:
            values = self._gripper_values(bool(grasp.contact.any()))
            handle.publish_feedback(GripperCommand.Feedback(**values, reached_goal=False))

    def _send_vent(self) -> None:
        """Set every valve to 0 Pa now. The command belongs to no frame, so its stamp is the present time."""
        lifetime_ns = round(self._controller.settings.command_lifetime_s * 1e9)
        zero = np.zeros(len(self._hand.joints))
        self._command_publisher.publish(
            self._command_out.encode(self._now_ns(), lifetime_ns=lifetime_ns, pressure=zero)
        )

    def _on_watch(self) -> None:
        if self._controller.check(time.monotonic_ns()):
            self._send_vent()
        self._log_given_up()
        self._on_publishers()
        missing = self._heartbeat.missing(time.monotonic_ns())
        if missing and self._controller.safety.phase is not Phase.VENTED:
            self._trip(missing)
        fault = self._controller.safety.fault
        if fault:
            self.keep_fault(fault)
            self.log_throttled(Level.ERROR, "fault", f"vented: {fault}; call reset, then enable", RARELY_S)

    def _log_given_up(self) -> None:
        """Log why a hand that was enabled is vented again before it was driven."""
        safety = self._controller.safety
        if self._waited and safety.phase is Phase.VENTED and not safety.fault:
            self.log_throttled(Level.WARN, "not driven", f"not driven: {safety.reason}")
        self._waited = safety.phase is Phase.ARMING

    def _trip(self, fault: str) -> None:
        """Vent now because of a fault outside of the frames, and latch it."""
        self._controller.safety.trip(fault)
        if self.active:
            self._send_vent()

    def _on_publishers(self, _came: int = 0) -> None:
        """Hold, then vent, while a topic of which only one publisher may exist has a second one."""
        now_ns = time.monotonic_ns()
        verdict = self.conflict.update(now_ns, self.second_publishers())
        self._controller.held = verdict is not Verdict.ALONE
        if verdict is Verdict.ALONE:
            return
        self._controller.safety.explain_silence(now_ns, self.conflict.line)
        self.log_throttled(Level.ERROR, "authority", self.conflict.line, RARELY_S)
        if verdict is Verdict.VENT and self._controller.safety.phase is not Phase.VENTED:
            self._trip(self.conflict.line)

    def _on_stop(self) -> None:
        self._trip("emergency stop: a message arrived on emergency_stop")
        self.keep_fault(self._controller.safety.fault)

    def _on_heartbeat(self, _raw: bytes) -> None:
        self._heartbeat.beat(time.monotonic_ns())

    def _on_raw_command(self, raw: bytes) -> None:
        self._try(lambda: self._read(self._commands_in.joint_command, raw, self._on_command))

    def _on_raw_trajectory(self, raw: bytes) -> None:
        self._try(lambda: self._read(self._commands_in.trajectory, raw, self._on_trajectory))

    def _read(self, read: Callable[[bytes, float], Any], raw: bytes, use: Callable[[Any], None]) -> None:
        """Decode a command within its bounds and use it; what arrives too fast is dropped. ValueError: refused."""
        try:
            message = read(raw, time.monotonic())
        except ValueError as error:
            self._controller.refuse(str(error), time.monotonic_ns())
            raise
        if message is not None:
            use(message)

    def _on_command(self, message: JointState) -> None:
        times, unused = self._times(message), {"velocity": [message.velocity]}
        self._try(lambda: self._controller.command(times, message.name, message.position, message.effort, unused))

    def _on_trajectory(self, message: JointTrajectory) -> None:
        points = [(_seconds(point.time_from_start), point.positions, point.velocities) for point in message.points]
        times = self._times(message)
        unused = {name: [getattr(point, name) for point in message.points] for name in ("accelerations", "effort")}
        self._try(lambda: self._controller.trajectory(times, message.joint_names, points, unused))

    def _times(self, message: JointState | JointTrajectory) -> Times:
        return Times(_ns(message), self._now_ns(), time.monotonic_ns())

    def _try(self, accept: Callable[[], None]) -> None:
        """Report a refused command on the log and on diagnostics; control continues."""
        if not self.active:
            return
        try:
            accept()
        except ValueError as error:
            self.log_throttled(Level.ERROR, "refused", str(error))

    def _on_vent(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._controller.vent("vent was called")
        if self.active:
            self._send_vent()
        response.success, response.message = True, "vented; call enable to drive the hand again"
        return response

    def _on_reset(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if not self._controller.safety.fault:
            response.message = "no fault is latched; call enable to drive the hand"
            return response
        try:
            self.clear_fault()
        except ValueError as error:
            response.message = str(error)
            return response
        response.success = True
        response.message = f"cleared: {self._controller.reset()}; call enable to drive the hand"
        return response

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        try:
            if not self.active:
                raise ValueError("the controller is not active")
            if request.data and (missing := self._heartbeat.missing(time.monotonic_ns())):
                raise ValueError(f"not enabled: {missing}")
            if request.data and self.conflict.line:
                raise ValueError(f"not enabled: {self.conflict.line}")
            self._controller.enable(request.data)
            if not request.data:
                self._send_vent()
            response.success, response.message = True, "enabled" if request.data else "vented"
        except ValueError as error:
            response.message = str(error)
        return response

    def health(self) -> list[Health]:
        """Safety, commands and inputs."""
        if not self.active:
            return [Health("safety", Level.OK, "vented: not active")]
        statuses = [*self._controller.health(time.monotonic_ns()), self.authority_health(), *self.stop_health()]
        for status in statuses:
            if status.name == "valves" and status.level == Level.ERROR:
                self.log_throttled(Level.ERROR, "valves", status.message, RARELY_S)
        if self._input_fault:
            statuses.append(Health("input", Level.ERROR, self._input_fault))
        if flood := self._commands_in.problem(time.monotonic()):
            statuses.append(Health("floods", Level.WARN, flood))
        return statuses


def _ns(message: JointState | JointTrajectory) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _seconds(duration: Any) -> float:
    """Seconds of a builtin_interfaces/Duration."""
    return float(duration.sec) + float(duration.nanosec) * 1e-9


def main() -> None:
    """Entry point of the executable `controller`."""
    end(run(ControllerNode))
