"""The recorder node: writes every topic of a hand, as serialized bytes, into a rosbag2 recording.

No executor runs here. The recorder empties its subscriptions fifty times a second, which costs a fraction of waking up
for every message; the middleware stamps the receipt and queues the messages. This is the only module of hand_recording
that imports rclpy.
"""

from __future__ import annotations

import importlib
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from typing import Any

import rclpy
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.callback_groups import CallbackGroup
from rclpy.exceptions import InvalidNamespaceException
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

from hand_recording.bag_writer import STORAGES, Arrival, Arrivals, BagError, Topic, open_bag
from hand_recording.message_types import UnknownType
from hand_recording.queue_bound import QUEUE, ROUND_BYTES, QueueBound
from hand_recording.record_options import RecordOptions, RecordSummary, Selection, summarize
from hand_recording.recorder_health import RecorderHealth
from hand_ros.parameters import NodeParameter, check_all

PERIOD_S = 0.02
DISCOVERY_S = 0.2
PROGRESS_S = 0.5
ANSWERS = 2
"""Requests to the parameter services that are answered every DISCOVERY_S."""
PARAMETERS = (
    NodeParameter("out", "", "new folder, or NAME.mcap for one bare file; empty: hand_DATE_TIME"),
    NodeParameter("storage", "mcap", "file format", choices=STORAGES),
    NodeParameter("namespaces", [""], "record all topics below these; empty: the node's own, or /hand"),
    NodeParameter("rosout", False, "record /rosout too"),
    NodeParameter("duration_s", 0.0, "end after this time [s]; 0: record until stopped", low=0.0, high=1e9),
)


def record(
    options: RecordOptions,
    until: Callable[[float], bool],
    progress: Callable[[RecordSummary], None] | None = None,
    args: Sequence[str] | None = None,
) -> RecordSummary:
    """Record until the duration is over or `until` returns True.

    until: waits for at most the given seconds and returns whether to stop, like threading.Event.wait.
    progress: called twice a second with the summary so far.  args: ROS arguments.
    Raises BagError where the recording cannot be written, ValueError for a namespace that no node can have.
    """
    rclpy.init(args=list(args or ()), signal_handler_options=SignalHandlerOptions.NO)
    try:
        return _run(_node_beside(options.selection.namespaces[0]), options, until, progress)
    finally:
        rclpy.try_shutdown()


def _node_beside(hand: str) -> Node:
    """A recorder in the namespace of a hand, to which the policy of config/security belongs."""
    try:
        return Node("recorder", namespace=f"/{hand.strip('/')}", start_parameter_services=False, enable_rosout=False)
    except InvalidNamespaceException:
        raise ValueError(f"namespace {hand!r}: only letters, digits, _ and / are allowed") from None


def main(args: Sequence[str] | None = None) -> None:
    """The executable `recorder`: options come as ROS parameters. Exit codes: 0 recorded, 2 bad input."""
    with stop_signals() as stop:
        try:
            try:
                rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
                node = Node("recorder")
            except Exception as error:  # rcl raises several unrelated classes for bad arguments
                raise ValueError(" ".join(str(error).split())) from error
            options = _options_of(node)
            summary = _run(node, options, stop.wait, _logging(node, options), _answering(node))
        except ValueError as error:
            print(f"recorder: {error}", file=sys.stderr)
            sys.exit(2)
        finally:
            rclpy.try_shutdown()
    for topic in summary.topics:
        print(f"{topic.name}: {topic.messages} messages, {topic.rate_hz:.1f} Hz, {topic.missed} missed")
    for name, reason in summary.limited.items():
        print(f"{name}: {reason}")


def _logging(node: Node, options: RecordOptions) -> Callable[[RecordSummary], None]:
    """A function that logs whether a recording works."""
    health, logger = RecorderHealth(options.selection.namespaces), node.get_logger()

    def log(summary: RecordSummary) -> None:
        if line := health.healthy(summary):
            logger.info(line)
        if line := health.silent(summary):
            logger.warning(line)

    return log


@contextmanager
def stop_signals() -> Iterator[threading.Event]:
    """An event that SIGINT and SIGTERM set while the context lasts."""
    event = threading.Event()
    before = {number: signal.signal(number, lambda *_: event.set()) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield event
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _options_of(node: Node) -> RecordOptions:
    """Declare, read and check the node's parameters. Raises ValueError."""
    values = {}
    for parameter in PARAMETERS:
        descriptor = ParameterDescriptor(description=parameter.description, read_only=True, dynamic_typing=True)
        values[parameter.name] = node.declare_parameter(parameter.name, parameter.default, descriptor).value
    check_all(PARAMETERS, values)
    namespace = node.get_namespace()
    spaces = [space for space in values["namespaces"] if space] or ["/hand" if namespace == "/" else namespace]
    return RecordOptions(
        Path(values["out"] or time.strftime("hand_%Y-%m-%d_%H-%M-%S")),
        values["storage"],
        Selection(tuple(spaces), (), values["rosout"]),
        values["duration_s"] or None,
    )


def _run(
    node: Node,
    options: RecordOptions,
    until: Callable[[float], bool],
    progress: Callable[[RecordSummary], None] | None,
    answer: Callable[[], None] = lambda: None,
) -> RecordSummary:
    """Record; answer is called every DISCOVERY_S."""
    recorder = _Recorder(node, options)
    try:
        began = now = time.monotonic()
        next_search = next_report = began
        end = began + options.duration_s if options.duration_s else float("inf")
        while now < end:
            if now >= next_search:
                recorder.discover()
                answer()
                next_search = now + DISCOVERY_S
            recorder.collect(time.time_ns(), time.monotonic_ns())
            if progress and now >= next_report:
                progress(recorder.summary(now - began))
                next_report = now + PROGRESS_S
            if until(min(PERIOD_S, max(end - now, 0.0))):
                break
            now = time.monotonic()
        return recorder.finish(time.monotonic() - began)
    except OSError as error:
        raise BagError(
            f"{options.out} cannot be written further: {error.strerror}; what was recorded before is kept;"
            f" complete it, where there is space, with: hand record --repair {options.out}"
        ) from error
    finally:
        recorder.abandon()
        node.destroy_node()


class _Untouched(CallbackGroup):
    """Keeps an executor from taking messages of its subscriptions: the recorder takes them itself."""

    def can_execute(self, _entity: Any) -> bool:
        """Never."""
        return False

    def beginning_execution(self, _entity: Any) -> bool:
        """Never."""
        return False

    def ending_execution(self, _entity: Any) -> None:
        """Nothing has begun."""


def _answering(node: Node) -> Callable[[], None]:
    """A function that answers the requests to the parameter services of a node that have arrived."""
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    def answer() -> None:
        for _ in range(ANSWERS):
            executor.spin_once(timeout_sec=0.0)

    return answer


class _Subscribed:
    """The subscription of one recorded topic; replaced where the offered QoS is no longer compatible with it."""

    def __init__(self, node: Node, topic: str, kind: Any, qos: QoSProfile) -> None:
        self.qos = qos
        self.publishers = 0
        self.kind = kind
        self._node = node
        group = _Untouched()
        self._handle = node.create_subscription(kind, topic, lambda _: None, qos, raw=True, callback_group=group)

    def take(self) -> Iterator[tuple[bytes, dict[str, int]]]:
        """Every queued message, with its times."""
        with self._handle.handle:
            while (taken := self._handle.handle.take_message(self.kind, True)) is not None:
                yield taken

    def destroy(self) -> None:
        """Unsubscribe."""
        self._node.destroy_subscription(self._handle)


class _Recorder:
    """Discovers topics, subscribes to them, takes their messages and writes them."""

    def __init__(self, node: Node, options: RecordOptions) -> None:
        self._node = node
        self._options = options
        self._bag = open_bag(options.out, options.storage)
        self._arrivals = Arrivals(self._bag)
        self._subscribed: dict[str, _Subscribed] = {}
        self._skipped: dict[str, str] = {}
        self._queues = QueueBound()

    def discover(self) -> None:
        """Subscribe to new topics, and again to those whose publishers now offer a weaker QoS."""
        chosen = self._options.selection.choose(self._node.get_topic_names_and_types())
        for name, types in chosen.items():
            offers = self._node.get_publishers_info_by_topic(name)
            if not offers or name in self._skipped:
                continue
            if name not in self._subscribed:
                self._add(name, types, offers)
            elif _suiting(offers, self._queues.depth(name)) != self._subscribed[name].qos:
                self._take(name)
                self._subscribe_again(name, _suiting(offers, self._queues.depth(name)))
            if name in self._subscribed:
                self._subscribed[name].publishers = len(offers)

    def collect(self, now_ns: int, monotonic_ns: int) -> None:
        """Take the queued messages and write those received by now_ns [ns], or all where they have ROUND_BYTES."""
        taken = 0
        for name in list(self._subscribed):
            taken += self._take(name)
            if taken >= ROUND_BYTES:
                self._arrivals.write(sys.maxsize)
                taken = 0
        self._arrivals.write(now_ns)
        self._bag.tick(monotonic_ns)

    def summary(self, duration_s: float) -> RecordSummary:
        """The summary so far."""
        missed, limited = self._arrivals.missed, self._queues.lines()
        return summarize(self._options.out, duration_s, self._bag.contents, missed, self._skipped, limited)

    def finish(self, duration_s: float) -> RecordSummary:
        """Write the remaining messages and close the bag."""
        self.collect(sys.maxsize, time.monotonic_ns())
        self._bag.close()
        return self.summary(duration_s)

    def abandon(self) -> None:
        """Close the bag after a failure, as far as possible; without effect after finish."""
        with suppress(OSError):  # a full disk was reported already
            self._bag.close()

    def _take(self, name: str) -> int:
        """Take what a whole queue may hold; returns its bytes. What is left is taken in the next round."""
        subscribed, taken, shorten = self._subscribed[name], 0, False
        for raw, info in islice(subscribed.take(), QUEUE):
            arrival = Arrival(
                info["received_timestamp"] or time.time_ns(),
                name,
                raw,
                info["source_timestamp"],
                info["publication_sequence_number"] or 0,
            )
            self._arrivals.add(arrival, subscribed.publishers == 1)
            taken += len(raw)
            shorten = self._queues.shortened(name, len(raw)) or shorten
            if taken >= ROUND_BYTES:
                break
        if shorten:
            self._node.get_logger().warning(f"{name}: {self._queues.line(name)}")
            self._subscribe_again(name, _of_depth(subscribed.qos, self._queues.depth(name)))
        return taken

    def _add(self, name: str, types: Sequence[str], offers: Sequence[Any]) -> None:
        try:
            if len(types) != 1:
                raise UnknownType(f"{name}: published with several types: {', '.join(types)}")
            topic = Topic.of(name, types[0], [_recorded(offer.qos_profile) for offer in offers])
            wire = str(offers[0].topic_type_hash)
            if wire.startswith("RIHS01_") and wire != topic.type_hash:
                raise UnknownType(f"{name}: the publisher's {types[0]} is another version than the one found here")
            self._subscribe(name, types[0], offers)
        except (UnknownType, ImportError, AttributeError) as error:
            self._skipped[name] = str(error)
            self._node.get_logger().warning(f"not recorded: {error}")
        else:
            self._bag.add_topic(topic)

    def _subscribe(self, name: str, type_name: str, offers: Sequence[Any]) -> None:
        package, _, kind = type_name.partition("/msg/")
        message = getattr(importlib.import_module(f"{package}.msg"), kind)
        self._subscribed[name] = _Subscribed(self._node, name, message, _suiting(offers, self._queues.depth(name)))

    def _subscribe_again(self, name: str, qos: QoSProfile) -> None:
        """Replace a subscription by one of another QoS."""
        before = self._subscribed.pop(name)
        before.destroy()
        self._subscribed[name] = made = _Subscribed(self._node, name, before.kind, qos)
        made.publishers = before.publishers


def _suiting(offers: Sequence[Any], depth: int) -> QoSProfile:
    """The strictest QoS that is compatible with every publisher of a topic, with a queue of depth messages."""
    profiles = [offer.qos_profile for offer in offers]
    reliable = all(profile.reliability == ReliabilityPolicy.RELIABLE for profile in profiles)
    kept = all(profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for profile in profiles)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
    )


def _of_depth(qos: QoSProfile, depth: int) -> QoSProfile:
    """The same with a queue of depth messages."""
    return QoSProfile(history=qos.history, depth=depth, reliability=qos.reliability, durability=qos.durability)


def _recorded(profile: QoSProfile) -> Qos:
    """An offered profile as a bag stores it."""
    return Qos(
        QosHistory(int(profile.history)),
        profile.depth,
        QosReliability(int(profile.reliability)),
        QosDurability(int(profile.durability)),
        _duration(profile.deadline),
        _duration(profile.lifespan),
        QosLiveliness(int(profile.liveliness)),
        _duration(profile.liveliness_lease_duration),
        profile.avoid_ros_namespace_conventions,
    )


def _duration(duration: Any) -> QosTime:
    return QosTime(*divmod(duration.nanoseconds, 1_000_000_000))


if __name__ == "__main__":
    main()
