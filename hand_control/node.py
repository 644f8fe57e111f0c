"""The controller node: joint states and pressures in, valve commands out. The only rclpy module here."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from hand_msgs.msg import ControllerState, JointPressures, ValveCommand
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from hand_control.controller import Controller, Tick
from hand_control.inputs import JointInput
from hand_control.settings import PARAMETERS, Settings
from hand_control.supervisor import FREEZE_S
from hand_model.description import Hand, load_hand
from hand_ros.cdr import Layout
from hand_ros.health import Health, Level
from hand_ros.layouts import CONTROLLER_STATE, JOINT_PRESSURES, JOINT_STATE, VALVE_COMMAND
from hand_ros.node import COMMAND_QOS, QUEUED_QOS, SENSOR_QOS, STATE_QOS, HandNode, default_config, run

WATCH_PERIOD_S = 0.02
"""Silence is noticed this late at most; the board vents by the lifetime of its set-points anyway."""


class ControllerNode(HandNode):
    """Ticks once for each joint state; a timer watches for silence."""

    def __init__(self) -> None:
        """Declare parameters."""
        super().__init__("controller", PARAMETERS)
        self._interfaces: list[Callable[[], object]] = []

    def configure(self, values: dict[str, Any]) -> None:
        """Load the description, check the settings, create publishers, subscriptions and services."""
        self._hand: Hand = load_hand(values["hand_description"] or default_config("hand.yaml"))
        self._settings = Settings.of(self._hand, values)
        self._enabled_at_start = values["enabled_at_start"]
        self._controller = Controller(self._hand, self._settings)
        joints, frame_id = self._hand.joints, values["frame_id"]
        self._states_in = JointInput(JOINT_STATE, joints, ("position", "velocity"))
        self._pressures_in = JointInput(JOINT_PRESSURES, joints, ("pressure",))
        self._command_out = Layout(VALVE_COMMAND, frame_id, joints)
        self._state_out = Layout(CONTROLLER_STATE, frame_id, joints)
        self._input_fault = ""
        self._warm_up()
        self._create_interfaces()

    def _warm_up(self) -> None:
        """Load the compiled kernels before the first frame: that takes longer than a frame may be late."""
        joints = np.zeros(len(self._hand.joints))
        rehearsal = Controller(self._hand, self._settings)
        rehearsal.enable(True)
        for stamp_ns in (1, 2, 3):
            rehearsal.frame(stamp_ns, stamp_ns, stamp_ns, joints, joints, joints)

    def _create_interfaces(self) -> None:
        self._command_publisher = self.create_publisher(ValveCommand, "valve_command", COMMAND_QOS)
        self._state_publisher = self.create_publisher(ControllerState, "controller_state", SENSOR_QOS)
        subscriptions = (
            self.create_subscription(JointPressures, "pressures", self._on_pressures, SENSOR_QOS, raw=True),
            self.create_subscription(JointState, "joint_states", self._on_joint_states, STATE_QOS, raw=True),
            self.create_subscription(JointState, "joint_commands", self._on_command, QUEUED_QOS),
            self.create_subscription(JointTrajectory, "joint_trajectory", self._on_trajectory, QUEUED_QOS),
        )
        services = (
            self.create_service(Trigger, "vent", self._on_vent),
            self.create_service(Trigger, "reset", self._on_reset),
            self.create_service(SetBool, "enable", self._on_enable),
        )
        self._interfaces = [
            lambda: self.destroy_publisher(self._command_publisher),
            lambda: self.destroy_publisher(self._state_publisher),
            *(lambda s=s: self.destroy_subscription(s) for s in subscriptions),  # type: ignore[misc]
            *(lambda s=s: self.destroy_service(s) for s in services),  # type: ignore[misc]
        ]

    def reconfigure(self, values: dict[str, Any]) -> None:
        """New gains and limits, all or none, without a jump."""
        self._controller.configure(Settings.of(self._hand, values))

    def start(self) -> None:
        """Begin to control, from the pose the hand has."""
        self._pressure: NDArray[np.float64] = np.full(len(self._hand.joints), np.nan)
        self._pressure_ns = 0
        if self._enabled_at_start:
            self._controller.enable(True)
        self._watch = self.create_timer(WATCH_PERIOD_S, self._on_watch)

    def stop(self) -> None:
        """Vent and say so; the last command does not survive."""
        self.destroy_timer(self._watch)
        self._controller.vent("the controller was deactivated")
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
            return  # no pressures to go with it: not a usable frame, and silence vents
        tick = self._controller.frame(stamp_ns, self._now_ns(), host_ns, position, velocity, self._pressure)
        if tick is not None:
            self._publish(tick)
        self._input_fault = ""

    def _input_problem(self, line: str) -> None:
        """Input that cannot be used: no frame, so that silence vents; said once in a while."""
        self._input_fault = line
        self.say(Level.ERROR, "input", line)

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

    def _send_vent(self) -> None:
        """Set every valve to 0 Pa now. It answers no frame, so it bears the present time."""
        lifetime_ns = round(self._controller.settings.command_lifetime_s * 1e9)
        zero = np.zeros(len(self._hand.joints))
        self._command_publisher.publish(
            self._command_out.encode(self._now_ns(), lifetime_ns=lifetime_ns, pressure=zero)
        )

    def _on_watch(self) -> None:
        if self._controller.check(time.monotonic_ns()):
            self._send_vent()
        if self._controller.safety.fault:
            self.say(Level.ERROR, "fault", f"vented: {self._controller.safety.fault}; call reset, then enable")

    def _on_command(self, message: JointState) -> None:
        self._try(
            lambda: self._controller.command(
                message.name, message.position, message.effort, _ns(message), self._now_ns(), time.monotonic_ns()
            )
        )

    def _on_trajectory(self, message: JointTrajectory) -> None:
        points = [(_seconds(point), point.positions, point.velocities) for point in message.points]
        self._try(
            lambda: self._controller.trajectory(
                message.joint_names, points, _ns(message), self._now_ns(), time.monotonic_ns()
            )
        )

    def _try(self, accept: Callable[[], None]) -> None:
        """A command that is refused is said on the log and on diagnostics; all else goes on."""
        if not self.active:
            return
        try:
            accept()
        except ValueError as error:
            self.say(Level.ERROR, "refused", str(error))
            self.publish_health()

    def _on_vent(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._controller.vent("vent was called")
        if self.active:
            self._send_vent()
        response.success, response.message = True, "vented; call enable to drive the hand again"
        return response

    def _on_reset(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        fault = self._controller.reset()
        response.success = True
        response.message = f"forgotten: {fault}; call enable to drive the hand" if fault else "no fault was latched"
        return response

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        try:
            if not self.active:
                raise ValueError("the controller is not active")
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
        statuses = self._controller.health(time.monotonic_ns())
        if self._input_fault:
            statuses.append(Health("input", Level.ERROR, self._input_fault))
        return statuses


def _ns(message: JointState | JointTrajectory) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _seconds(point: JointTrajectoryPoint) -> float:
    return float(point.time_from_start.sec) + float(point.time_from_start.nanosec) * 1e-9


def main() -> None:
    """Entry point of the executable `controller`."""
    sys.exit(run(ControllerNode))
