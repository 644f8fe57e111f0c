"""The base of every node: a lifecycle that can start itself, declared parameters, diagnostics, a safe shutdown.

This is the only module of hand_ros that imports rclpy.
"""

from __future__ import annotations

import faulthandler
import inspect
import os
import signal
import socket
import sys
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn, Protocol

import rclpy
from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.lifecycle import LifecycleNode, State, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher as RosPublisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.utilities import get_rmw_implementation_identifier
from std_msgs.msg import Empty

from hand_messages.bounds import Budget
from hand_messages.health import Health, Level
from hand_ros.fault_file import FaultFile, state_path
from hand_ros.memory import find_modules, lock_memory, return_large_blocks, spare_collections
from hand_ros.parameters import NodeParameter, ParameterError, check_all
from hand_ros.processes import processes
from hand_ros.publishers import Conflict, Publisher, SolePublishers
from hand_ros.rate_meter import RateMeter
from hand_ros.starting import told_to_start
from hand_ros.streams import Stream
from hand_ros.transport import use_profiles

SENSOR_QOS = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Of subscriptions to sensor topics: an old sample is not sent again."""
RELIABLE_SENSOR_QOS = QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE)
"""Of publishers of sensor topics: every subscriber connects (REP 2003)."""
STATE_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
LATCHED_STATE_QOS = QoSProfile(
    depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
"""Of publishers whose last messages a late subscriber may ask for."""
EVENT_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Of publishers of rare events, kept for late subscribers."""
COMMAND_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
QUEUED_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
LIVE_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Receives from every publisher, whatever its QoS, what it publishes from now on."""
RETAINED_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Keeps the last message for late subscribers; receives also what a transient-local publisher published before."""
RELAY_S = 5.0
"""Shortest time between two emergency stops that a node passes on."""
STOPS_HZ = 20.0
"""Emergency stops a second that are acted upon again while the hand is stopped already."""
STOP_SEARCH_S = 0.1
"""Period of the search for publishers that retain an emergency stop."""
RECEIVED_S = 0.3
"""A node that ends waits so long for reliable subscribers to receive what it published last."""
ENDS_S = 4.0
"""A node that has not ended after this time says where it hangs and ends; a launch kills it after 5 s."""
DEFAULT_NAMESPACE = "hand"
LOG_PERIOD_S = 2.0
CHANGE_PERIOD_S = 0.09
"""Shortest time between two messages of diagnostics, however often a status changes: just below the timer's period."""
RARELY_S = 600.0
"""Period in which a line that does not change, as that of a latched fault, is logged again."""
STATE_FILE = NodeParameter(
    "state_file",
    "",
    "file that keeps a latched fault; empty: NAMESPACE.NODE.json in $ROS_HOME/fluidic_hand or ~/.ros/...",
)
AUTOSTART = NodeParameter("autostart", True, "configure and activate at start, without a lifecycle manager")
EXIT_UNCONFIGURED = NodeParameter(
    "exit_unconfigured",
    False,
    "end with exit code 2 where the configuration at start fails; otherwise wait for another",
)


class HandNode(LifecycleNode):
    """A lifecycle node with declared parameters, throttled log lines and diagnostics.

    Subclasses override configure, start, stop, release and health; start, stop and health are called only after
    configure has succeeded.
    """

    def __init__(self, name: str, table: tuple[NodeParameter, ...]) -> None:
        """Declare the parameters of the table; files and ports are opened by on_configure."""
        super().__init__(name, namespace=DEFAULT_NAMESPACE)
        self.table = (AUTOSTART, EXIT_UNCONFIGURED, *table)
        self.problem: str | None = None
        self.active = False
        self.configured = False
        self._sole = SolePublishers(processes)
        self._streams: dict[str, Stream] = {}
        self.conflict = Conflict()
        self._stops = Budget(STOPS_HZ, round(STOPS_HZ))
        self._counts: dict[str, int] = {}
        self._logged: dict[str, tuple[float, str]] = {}
        self._healthy = False
        self.cycles: int | None = None
        self._rate = RateMeter()
        self._shown: list[tuple[str, Level, str]] = []
        self._shown_at = 0.0
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", QUEUED_QOS)
        for parameter in self.table:
            self._declare(parameter)
        self._health_timer = self.create_timer(0.1, self.publish_health)
        self.add_on_set_parameters_callback(self._on_set_parameters)

    def frame_id(self, values: Mapping[str, Any], palm: str = "") -> str:
        """The frame of the hand: the parameter, the frame of its palm, or the namespace, so that two hands differ."""
        return str(values["frame_id"]) or palm or self.get_namespace().strip("/") or DEFAULT_NAMESPACE

    @property
    def values(self) -> dict[str, Any]:
        """Current value of every declared parameter."""
        return {p.name: p.converted(self.get_parameter(p.name).value) for p in self.table}

    def _declare(self, parameter: NodeParameter) -> None:
        """Declare a parameter; an integer given at the start for a float is converted.

        Raises ParameterError, one line, where the given value has another type.
        """
        descriptor = _descriptor(parameter)
        try:
            self.declare_parameter(parameter.name, parameter.default, descriptor)
        except InvalidParameterTypeException:
            of_any_type = ParameterDescriptor(dynamic_typing=True)
            given = self.declare_parameter(parameter.name, parameter.default, of_any_type).value
            value = parameter.converted(given)
            parameter.check(value)
            self.undeclare_parameter(parameter.name)
            self.declare_parameter(parameter.name, value, descriptor, ignore_override=True)

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """As rclpy does it, for integers given for floats too; a read-only parameter may be set to the value it has.

        So `ros2 param load` accepts what `ros2 param dump` wrote.
        """
        table = {parameter.name: parameter for parameter in self.table}
        changed = []
        for given in parameter_list:
            value, name = given.value, given.name
            if name in table and value is not None:
                try:
                    table[name].check_size(value)
                except ParameterError as error:
                    return SetParametersResult(successful=False, reason=str(error))
                value = table[name].converted(value)
                given = Parameter(name, value=value)
            unchanged = self.has_parameter(name) and value == self.get_parameter(name).value
            if not (unchanged and self.describe_parameter(name).read_only):
                changed.append(given)
        if not changed and parameter_list:
            return SetParametersResult(successful=True)
        return super().set_parameters_atomically(changed)

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

    def described(self) -> str:
        """What the node is, for its log: its name and what it works on."""
        return str(self.get_name())

    def on_configure(self, _state: State) -> TransitionCallbackReturn:
        """Lifecycle: check the parameters, then configure."""
        try:
            values = self.values
            check_all(self.table, values)
            self.configure(values)
        except (ValueError, OSError) as error:
            return self._failed(one_line(error))
        except Exception as error:  # a defect of this program, which rclpy would not report
            self.get_logger().error(traceback.format_exc())
            return self._failed(f"internal error: {type(error).__name__}: {one_line(error)}")
        self.problem, self.configured = None, True
        find_modules()
        spare_collections()
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
        table = {parameter.name: parameter for parameter in self.table}
        given = {new.name: table[new.name].converted(new.value) for new in changed if new.name in table}
        values = self.values | given
        try:
            check_all(self.table, values)
            if self.configured:
                self.reconfigure(values)
        except ValueError as error:
            return SetParametersResult(successful=False, reason=one_line(error))
        return SetParametersResult(successful=True)

    def _halt(self) -> None:
        if self.active:
            self.active = False
            self.stop()
            self.keep_fault(self.latched_fault())  # the next configuration reads it

    def finish(self) -> None:
        """End of the process: stop, publish the last statuses, wait until they are received, release the ports."""
        self._halt()
        self.publish_health(now=True)
        end = time.monotonic() + RECEIVED_S  # a last command that vents is sent again as long as its publisher lives
        for publisher in self.publishers:
            publisher.wait_for_all_acked(Duration(seconds=max(0.0, end - time.monotonic())))
        self.release()

    def destroy_node(self) -> None:
        """Free everything of the node; rclpy forgets the state machine, and with it the DDS participant."""
        super().destroy_node()
        self._state_machine.destroy_when_not_in_use()

    def log_throttled(self, level: Level, key: str, line: str, again_s: float = LOG_PERIOD_S) -> None:
        """Log one line, at most once in LOG_PERIOD_S for each key, and a line that does not change once in again_s."""
        now = time.monotonic()
        when_s, last = self._logged.get(key, (-RARELY_S, ""))
        if now - when_s < (again_s if line == last else LOG_PERIOD_S):
            return
        self._logged[key] = (now, line)
        logger = self.get_logger()
        # Each severity has a line of its own: rclpy refuses another severity from the same line.
        if level == Level.OK:
            logger.info(line)
        elif level == Level.WARN:
            logger.warning(line)
        else:
            logger.error(line)

    def latched_fault(self) -> str:
        """The fault that is latched now, empty for none; of nodes that call `load_fault`."""
        return ""

    def load_fault(self, state_file: str) -> str:
        """The fault that was latched before a restart, or why that cannot be known, one line; empty for none."""
        path = state_path(state_file, self.get_namespace(), self.get_name(), os.environ)
        self._faults = FaultFile(path, self.get_fully_qualified_name())
        return self._faults.read()

    def keep_fault(self, fault: str) -> None:
        """Store a latched fault for a restart; called again and again while it is latched."""
        if fault and not self._faults.keep(fault, time.monotonic_ns()):
            self.log_throttled(Level.ERROR, "state file", self._faults.problem, RARELY_S)

    def clear_fault(self) -> None:
        """Remove the stored fault. Raises ValueError, one line, where that fails; then the fault stays latched."""
        try:
            self._faults.clear()
        except OSError as error:
            raise ValueError(f"not reset: the state file {self._faults.path}: {error.strerror}") from error

    def sole_publisher(self, kind: Any, topic: str, qos: QoSProfile) -> RosPublisher:
        """A publisher of a topic of which only one may exist; `second_publishers` names any other."""
        before = {publisher.gid for publisher in self._publishers_of(topic)}
        made = self.create_publisher(kind, topic, qos)
        name = self.get_fully_qualified_name()
        for publisher in self._publishers_of(topic):
            if publisher.gid not in before and publisher.node == name:
                self._sole.own(topic, publisher)
        self._counts[topic] = -1
        return made

    def sole_source(
        self, kind: Any, topic: str, callback: Callable[[bytes], None], qos: QoSProfile, changed: Callable[[int], None]
    ) -> Subscription:
        """A subscription of serialized messages to a topic of which only one publisher may exist.

        callback: called with the messages of the publisher that is followed, and with no other.
        changed: called with the number of publishers that came, 0 for a message of one that DDS has not shown yet.
        """
        stream = self._streams[topic] = Stream()

        @_with_info
        def received(raw: bytes, info: dict[str, Any]) -> None:
            now_ns = time.monotonic_ns()
            known = stream.disturbed(now_ns)
            if stream.take(info["publication_sequence_number"], now_ns):
                callback(raw)
            elif not known:
                changed(0)

        def matched(event: Any) -> None:
            self._counts[topic] = -1
            changed(event.total_count_change)

        events = SubscriptionEventCallbacks(matched=matched)
        self._counts[topic] = -1
        return self.create_subscription(kind, topic, received, qos, raw=True, event_callbacks=events)

    def second_publishers(self) -> str:
        """Names every second publisher of such topics, one line; empty where there is none. Cheap to call often."""
        for topic, last in self._counts.items():
            count = self.count_publishers(self.resolve_topic_name(topic))
            if count != last or count > 1:
                self._counts[topic] = count
                self._sole.update(topic, self._publishers_of(topic))
        now_ns = time.monotonic_ns()
        return self._sole.line([topic for topic, stream in self._streams.items() if stream.disturbed(now_ns)])

    def gives_way_to(self, topic: str) -> str:
        """The node whose publisher of a topic keeps this node from publishing; empty where there is none."""
        present = self._publishers_of(self.resolve_topic_name(topic))
        other = self._sole.gives_way_to(topic, present, self.get_fully_qualified_name())
        return "" if other is None else other.node

    def destroy_sole_publisher(self, topic: str, made: RosPublisher) -> None:
        """Publish such a topic no longer."""
        self.destroy_publisher(made)
        self._sole.disown(topic)
        del self._counts[topic]

    def accepted_publisher(self, topic: str) -> bytes:
        """Identifier of the publisher of a topic that is not a second one; empty for none."""
        return self._sole.accepted(topic)

    def authority_health(self) -> Health:
        """The status that names a second publisher, and how DDS marks this machine."""
        values = {"host": socket.gethostname(), "dds_host": self._sole.host}
        line = self.conflict.line
        if line:
            return Health("authority", Level.ERROR, line, values)
        return Health("authority", Level.OK, "one publisher of each topic", values)

    def _publishers_of(self, topic: str) -> list[Publisher]:
        return [
            Publisher(_node_name(info), bytes(info.endpoint_gid)) for info in self.get_publishers_info_by_topic(topic)
        ]

    def listen_to_stop(self, on_stop: Callable[[], None], stopped: Callable[[], bool]) -> Callable[[], None]:
        """Call on_stop for every message on `emergency_stop`, of any publisher; returns what ends it.

        stopped: whether the hand is vented and latched; while it is, on_stop is called STOPS_HZ times a second at most.
        The message is passed on, at most once in RELAY_S: one that is published once, by a process that ends at once,
        may reach some of the nodes only.
        """
        topic = "emergency_stop"
        relay = self.create_publisher(Empty, topic, 1)
        passed_s = -RELAY_S

        def stop(_raw: bytes) -> None:
            nonlocal passed_s
            if not self._stops.take(time.monotonic()) and stopped():
                return  # it has nothing left to stop
            on_stop()
            if time.monotonic() - passed_s >= RELAY_S:
                passed_s = time.monotonic()
                relay.publish(Empty())

        live = self.create_subscription(Empty, topic, stop, LIVE_QOS, raw=True)
        retained: list[Subscription] = []

        def follow() -> None:
            """Subscribe to retained messages only while a publisher retains: all others would log a mismatch."""
            offers = [info.qos_profile for info in self.get_publishers_info_by_topic(topic)]
            wanted = any(offer.durability == DurabilityPolicy.TRANSIENT_LOCAL for offer in offers)
            if wanted and not retained:
                quiet = SubscriptionEventCallbacks(use_default_callbacks=False)
                retained.append(
                    self.create_subscription(Empty, topic, stop, RETAINED_QOS, raw=True, event_callbacks=quiet)
                )
            elif retained and not wanted:
                self.destroy_subscription(retained.pop())

        timer = self.create_timer(STOP_SEARCH_S, follow)

        def end() -> None:
            self.destroy_timer(timer)
            self.destroy_publisher(relay)
            for subscription in (live, *retained):
                self.destroy_subscription(subscription)

        return end

    def stop_health(self) -> list[Health]:
        """The status that reports a flood of emergency stops, where there is one."""
        flood = self._stops.problem(time.monotonic())
        return [Health("emergency_stop", Level.WARN, f"emergency_stop: {flood}")] if flood else []

    def publish_health(self, now: bool = False) -> None:
        """Publish the statuses at 1 Hz, and within 0.1 s when one changes."""
        statuses = [Health("setup", Level.OK, "not configured")]
        if self.problem:
            statuses = [Health("setup", Level.ERROR, self.problem)]
        elif self.configured:
            statuses = self.health()
        self._log_recovery(statuses)
        verdicts = [status.verdict for status in statuses]
        clock = time.monotonic()
        least_s = 1.0 if verdicts == self._shown else CHANGE_PERIOD_S
        if not now and clock - self._shown_at < least_s:
            return
        self._shown, self._shown_at = verdicts, clock
        message = DiagnosticArray()
        message.header.stamp = self.get_clock().now().to_msg()
        message.status = [self._status(status) for status in statuses]
        self._diagnostics.publish(message)

    def _log_recovery(self, statuses: list[Health]) -> None:
        """Log one line when everything is in order for the first time, or again after an error or a silence.

        A node that counts cycles is in order only while it has some; errors are logged where they are found.
        """
        now_s = time.monotonic()
        rate_hz = self._rate.update(self.cycles if self.active else None, now_s)
        worst = max((status.level for status in statuses), default=Level.OK)
        silent = self._rate.silent(now_s)
        if not self.active or worst == Level.ERROR or silent:
            self._healthy = False
        elif worst == Level.OK and not self._healthy and (self.cycles is None or rate_hz):
            self._healthy = True
            rate = "" if rate_hz is None else f" at {rate_hz:.0f} Hz"
            safety = "".join(f"; {status.message}" for status in statuses if status.name == "safety")
            line = f"healthy: {self.described()} runs in {self.get_namespace()}{rate}{safety}"
            self.log_throttled(Level.OK, "healthy", line)
        if self.active and silent and worst != Level.ERROR:
            line = f"not healthy: {self.described()} in {self.get_namespace()} receives no frames"
            self.log_throttled(Level.WARN, "silent", line, RARELY_S)

    def _status(self, status: Health) -> DiagnosticStatus:
        values = {"level": str(int(status.level))}
        return DiagnosticStatus(
            level=bytes([status.level]),
            name=f"{self.get_fully_qualified_name()}: {status.name}",
            message=status.message,
            hardware_id=self.get_namespace(),
            # PlotJuggler plots the numbers among the values, and not the level itself.
            values=[KeyValue(key=key, value=value) for key, value in (values | status.values).items()],
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


def _with_info(callback: Callable[[bytes, dict[str, Any]], None]) -> Callable[..., None]:
    """A callback of message and info for every executor: the events executor of Jazzy passes both as one tuple."""

    def received(*given: Any) -> None:
        callback(*(given[0] if len(given) == 1 else given))

    received.__signature__ = inspect.signature(callback)  # type: ignore[attr-defined]  # by it rclpy knows what to pass
    return received


def default_config(name: str) -> str:
    """Path of a file in the installed config folder, or in the source tree where nothing is installed."""
    try:
        return str(Path(get_package_share_directory("fluidic_hand")) / "config" / name)
    except PackageNotFoundError:
        return str(Path(__file__).resolve().parent.parent / "config" / name)


def _node_name(info: Any) -> str:
    """Fully qualified name of an endpoint's node. DDS gives it later than the endpoint, and for ROS 2 nodes only."""
    if "UNKNOWN" in info.node_name:
        return "a node whose name is not known (yet)"
    return f"{info.node_namespace.rstrip('/')}/{info.node_name}"


def one_line(error: BaseException) -> str:
    """The message of an error in one line; the name of its class where it has none."""
    return " ".join(str(error).split()) or type(error).__name__


class Destroyed(Protocol):
    """What a node does not destroy by itself, such as an ActionClient."""

    def destroy(self) -> None:
        """Free what it holds of the node."""


def join_graph(args: Sequence[str] | None = None) -> None:
    """Start ROS in this program, with our profiles of Fast DDS unless the user has some; signals stay with the program.

    With these profiles programs of one machine find each other within a second; without, it may take three.
    args: ROS arguments; default: those of the command line.
    """
    if get_rmw_implementation_identifier().startswith("rmw_fastrtps"):  # others would hear the whole network
        use_profiles(Path(default_config("fastdds.xml")).parent, os.environ, Path.cwd())
    rclpy.init(args=None if args is None else list(args), signal_handler_options=SignalHandlerOptions.NO)


def leave_graph(node: Node, executor: EventsExecutor | Executor, *besides: Destroyed) -> None:
    """End the node, its executor, what it does not destroy itself, and ROS in this program.

    The executor comes first. It holds what it has executed, and with it the DDS participant; Fast DDS would then end
    the participant after the program, from a static destructor, where a discovery at that moment is a segmentation
    fault and not an exit code.
    """
    executor.shutdown()
    for each in besides:
        each.destroy()
    node.destroy_node()
    rclpy.try_shutdown()


def run(make_node: Callable[[], HandNode], args: list[str] | None = None) -> int:
    """Run one node until SIGINT, SIGTERM or shutdown; the process's exit code.

    The node's finish runs in every case in which the process itself survives, so that the hand is vented.
    """
    if not told_to_start():
        return 0
    signals: list[int] = []  # a Future has a lock, on which a handler could wait for the code that it interrupts
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: signals.append(number))
    return_large_blocks()
    lock_memory()
    try:
        join_graph(args)
        node = make_node()
    except Exception as error:  # rcl raises several unrelated classes for bad arguments
        print(f"cannot start: {one_line(error)}", file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    executor = EventsExecutor()
    executor.add_node(node)
    code = 0
    try:
        if node.get_parameter(AUTOSTART.name).value:
            if node.trigger_configure() == TransitionCallbackReturn.SUCCESS:
                node.trigger_activate()
            elif node.get_parameter(EXIT_UNCONFIGURED.name).value:
                code = 2
        while rclpy.ok() and not signals and code == 0:
            # The time is limited, because Python's signal handlers run between these calls only.
            executor.spin_until_future_complete(Future(), timeout_sec=0.1)
    finally:
        faulthandler.dump_traceback_later(ENDS_S, exit=True)  # works also where compiled code hangs
        node.finish()
        leave_graph(node, executor)
        faulthandler.cancel_dump_traceback_later()
    return code


def end(code: int) -> NoReturn:
    """End the process now with an exit code.

    `run` has vented the hand and left the network. What Python does besides, freeing compiled code, takes more time
    than a launch allows on a busy machine.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


__all__ = [
    "COMMAND_QOS",
    "EVENT_QOS",
    "LATCHED_STATE_QOS",
    "LIVE_QOS",
    "QUEUED_QOS",
    "RARELY_S",
    "RELIABLE_SENSOR_QOS",
    "RETAINED_QOS",
    "SENSOR_QOS",
    "STATE_FILE",
    "STATE_QOS",
    "HandNode",
    "ParameterError",
    "default_config",
    "end",
    "join_graph",
    "leave_graph",
    "one_line",
    "run",
]
