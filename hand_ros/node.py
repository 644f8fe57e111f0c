"""The base of every node: a lifecycle that can start itself, declared parameters, diagnostics, a safe shutdown.

This is the only module of hand_ros that imports rclpy.
"""

from __future__ import annotations

import signal
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rclpy
from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.experimental import EventsExecutor
from rclpy.lifecycle import LifecycleNode, State, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from hand_messages.health import Health, Level
from hand_ros.parameters import NodeParameter, ParameterError, check_all

SENSOR_QOS = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
STATE_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
COMMAND_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
QUEUED_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
DEFAULT_NAMESPACE = "hand"
LOG_PERIOD_S = 2.0
AUTOSTART = NodeParameter("autostart", True, "configure and activate at start, without a lifecycle manager")


class HandNode(LifecycleNode):
    """A lifecycle node with declared parameters, throttled log lines and diagnostics.

    Subclasses override configure, start, stop, release and health; start, stop and health are called only after
    configure has succeeded.
    """

    def __init__(self, name: str, table: tuple[NodeParameter, ...]) -> None:
        """Declare the parameters of the table; files and ports are opened by on_configure."""
        super().__init__(name, namespace=DEFAULT_NAMESPACE)
        self.table = (AUTOSTART, *table)
        self.problem: str | None = None
        self.active = False
        self.configured = False
        self._logged_at: dict[str, float] = {}
        self._shown: list[tuple[str, Level, str]] = []
        self._shown_at = 0.0
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", QUEUED_QOS)
        for parameter in self.table:
            self.declare_parameter(parameter.name, parameter.default, _descriptor(parameter))
        self._health_timer = self.create_timer(0.1, self.publish_health)
        self.add_on_set_parameters_callback(self._on_set_parameters)

    @property
    def values(self) -> dict[str, Any]:
        """Current value of every declared parameter."""
        return {parameter.name: self.get_parameter(parameter.name).value for parameter in self.table}

    def configure(self, values: dict[str, Any]) -> None:
        """Load files, open ports, create publishers. Raises ValueError or OSError, one line, where that fails."""
        raise NotImplementedError

    def reconfigure(self, values: dict[str, Any]) -> None:
        """Apply parameters changed at run time. Raises ValueError where they are refused; then none is applied."""

    def start(self) -> None:
        """Start the work of the node; called on activation."""

    def stop(self) -> None:
        """Stop the work and leave the hand vented; called on deactivation and before cleanup."""

    def release(self) -> None:
        """Undo configure."""

    def health(self) -> list[Health]:
        """Current statuses of a configured node."""
        return []

    def on_configure(self, _state: State) -> TransitionCallbackReturn:
        """Lifecycle: check the parameters, then configure."""
        try:
            values = self.values
            check_all(self.table, values)
            self.configure(values)
        except (ValueError, OSError) as error:
            return self._failed(_one_line(error))
        except Exception as error:  # a defect of this program, which rclpy would not report
            self.get_logger().error(traceback.format_exc())
            return self._failed(f"internal error: {type(error).__name__}: {_one_line(error)}")
        self.problem, self.configured = None, True
        return TransitionCallbackReturn.SUCCESS

    def _failed(self, problem: str) -> TransitionCallbackReturn:
        self.problem = problem
        self.get_logger().error(problem)
        self.publish_health(now=True)
        return TransitionCallbackReturn.FAILURE

    def on_activate(self, state: State) -> TransitionCallbackReturn:
        """Lifecycle: start."""
        self.active = True
        self.start()
        return super().on_activate(state)

    def on_deactivate(self, state: State) -> TransitionCallbackReturn:
        """Lifecycle: stop; the hand is safe afterwards."""
        self._halt()
        return super().on_deactivate(state)

    def on_cleanup(self, _state: State) -> TransitionCallbackReturn:
        """Lifecycle: release what configure acquired."""
        self._halt()
        self.configured = False
        self.release()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, _state: State) -> TransitionCallbackReturn:
        """Lifecycle: stop and release."""
        return self.on_cleanup(_state)

    def _on_set_parameters(self, changed: list[Parameter]) -> SetParametersResult:
        values = self.values | {parameter.name: parameter.value for parameter in changed}
        try:
            check_all(self.table, values)
            if self.configured:
                self.reconfigure(values)
        except ValueError as error:
            return SetParametersResult(successful=False, reason=_one_line(error))
        return SetParametersResult(successful=True)

    def _halt(self) -> None:
        if self.active:
            self.active = False
            self.stop()

    def finish(self) -> None:
        """End of the process: stop, publish the last statuses, release the ports."""
        self._halt()
        self.publish_health(now=True)
        self.release()

    def log_throttled(self, level: Level, key: str, line: str) -> None:
        """Log one line, at most once in LOG_PERIOD_S for each key."""
        now = time.monotonic()
        if now - self._logged_at.get(key, -LOG_PERIOD_S) < LOG_PERIOD_S:
            return
        self._logged_at[key] = now
        logger = self.get_logger()
        {Level.OK: logger.info, Level.WARN: logger.warning}.get(level, logger.error)(line)

    def publish_health(self, now: bool = False) -> None:
        """Publish the statuses at 1 Hz, and at once when one changes."""
        statuses = [Health("setup", Level.OK, "not configured")]
        if self.problem:
            statuses = [Health("setup", Level.ERROR, self.problem)]
        elif self.configured:
            statuses = self.health()
        verdicts = [status.verdict for status in statuses]
        clock = time.monotonic()
        if not now and verdicts == self._shown and clock - self._shown_at < 1.0:
            return
        self._shown, self._shown_at = verdicts, clock
        message = DiagnosticArray()
        message.header.stamp = self.get_clock().now().to_msg()
        message.status = [self._status(status) for status in statuses]
        self._diagnostics.publish(message)

    def _status(self, status: Health) -> DiagnosticStatus:
        return DiagnosticStatus(
            level=bytes([status.level]),
            name=f"{self.get_fully_qualified_name()}: {status.name}",
            message=status.message,
            hardware_id=self.get_namespace(),
            values=[KeyValue(key=key, value=value) for key, value in status.values.items()],
        )


def _descriptor(parameter: NodeParameter) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(description=parameter.description, read_only=parameter.read_only)
    descriptor.additional_constraints = ", ".join(parameter.choices)
    if parameter.low is not None and parameter.high is not None and not isinstance(parameter.default, list):
        if isinstance(parameter.default, int):
            ranges = [IntegerRange(from_value=int(parameter.low), to_value=int(parameter.high), step=0)]
            descriptor.integer_range = ranges
        else:
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=float(parameter.low), to_value=float(parameter.high), step=0.0)
            ]
    return descriptor


def default_config(name: str) -> str:
    """Path of a file in the installed config folder, or in the source tree where nothing is installed."""
    try:
        return str(Path(get_package_share_directory("fluidic_hand")) / "config" / name)
    except PackageNotFoundError:
        return str(Path(__file__).resolve().parent.parent / "config" / name)


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def run(make_node: Callable[[], HandNode], args: list[str] | None = None) -> int:
    """Run one node until SIGINT, SIGTERM or shutdown; the process's exit code.

    The node's finish runs in every case in which the process itself survives, so that the hand is vented.
    """
    stopped = Future()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set_result(None))
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = make_node()
    except Exception as error:  # rcl raises several unrelated classes for bad arguments
        print(f"cannot start: {_one_line(error)}", file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    executor = EventsExecutor()
    executor.add_node(node)
    try:
        autostart = node.get_parameter(AUTOSTART.name).value
        if autostart and node.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            node.trigger_activate()
        while rclpy.ok() and not stopped.done():
            # The time is limited, because Python's signal handlers run between these calls only.
            executor.spin_until_future_complete(stopped, timeout_sec=0.1)
    finally:
        node.finish()
        executor.remove_node(node)
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


__all__ = [
    "COMMAND_QOS",
    "QUEUED_QOS",
    "SENSOR_QOS",
    "STATE_QOS",
    "HandNode",
    "ParameterError",
    "default_config",
    "run",
]
