"""A client of a running hand, over the topics, services and actions of every node. The only rclpy module here."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import rclpy
import rclpy.duration
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticArray
from hand_msgs.action import Grasp
from hand_msgs.msg import ContactForces, ControllerState, JointPressures, ValveCommand
from rclpy.action import ActionClient
from rclpy.client import Client
from rclpy.experimental import EventsExecutor
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from hand_client.live_state import ERROR, LiveState
from hand_client.repeated_call import RepeatedCall
from hand_client.samples import Samples
from hand_ros.node import QUEUED_QOS, SENSOR_QOS, join_graph, leave_graph

RUNNING_S = 5.0
"""Longest wait for a hand that runs already; discovery takes up to 2.7 s."""
STARTING_S = 15.0
"""Longest wait for a controller where a driver runs already: both were just started."""
ANSWER_S, AGAIN_S = 5.0, 1.0
"""Longest wait for an answer, and time after which a service is called again; each may be called twice."""
CANCEL_S = 2.0
TICK_S = 0.02
STREAM_QOS = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Of topics of which every message counts: the program may not receive for 0.1 s."""


class NoHandError(RuntimeError):
    """No hand runs, or it does not answer; the message is one line that says what to start."""


class HandClient:
    """Context manager: a node in the namespace of the hand, and the state of the hand as its messages come."""

    def __init__(
        self, namespace: str = "hand", name: str = "hand_client", check: Callable[[], None] = lambda: None
    ) -> None:
        """Join the ROS graph; Ctrl-C stays with the program.

        check is called after every wait and may raise: the executor drops what a signal raises within a callback.
        """
        self._check, self._ended = check, False
        self.namespace = f"/{namespace.strip('/')}"
        self.state = LiveState()
        self.samples: Samples | None = None
        join_graph()
        self._node = rclpy.create_node(name, namespace=self.namespace)
        self._executor = EventsExecutor()
        self._executor.add_node(self._node)
        node = self._node
        node.create_subscription(JointState, "joint_states", self._on_joints, STREAM_QOS)
        node.create_subscription(JointPressures, "pressures", self._on_pressures, STREAM_QOS)
        node.create_subscription(ContactForces, "contact_forces", self._on_forces, SENSOR_QOS)
        node.create_subscription(ControllerState, "controller_state", self._on_state, SENSOR_QOS)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, QUEUED_QOS)
        self._publishers: dict[str, Publisher[Any]] = {}
        self._services: dict[str, Client[Any, Any]] = {}
        self._actions: list[ActionClient[Any, Any, Any]] = []
        self._stop = node.create_publisher(Empty, "emergency_stop", QUEUED_QOS)

    def __enter__(self) -> HandClient:
        """Return the client."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the ROS graph."""
        leave_graph(self._node, self._executor, *self._actions)

    def spin(self, seconds: float) -> None:
        """Receive messages for some time [s]."""
        try:
            try:
                self._executor.spin_until_future_complete(Future(), timeout_sec=seconds)
            finally:  # a signal within a callback is dropped, or becomes an error of the compiled executor
                if not self._ended:  # what ends the program may still wait for an answer
                    self._check()
        except BaseException:
            self._ended = True
            raise

    def until(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Receive messages until the condition holds; whether it did within timeout_s [s]."""
        end = time.monotonic() + timeout_s
        while not condition():
            if time.monotonic() > end:
                return False
            self.spin(TICK_S)
        return True

    def await_hand(self, timeout_s: float = RUNNING_S) -> None:
        """Wait at most timeout_s [s] for a driver, then STARTING_S for its controller. Raises NoHandError."""
        if not self.until(lambda: bool(self.state.joints), timeout_s):
            raise NoHandError(f"no hand runs in {self.namespace}; start one with: hand up --sim")
        if not self.until(lambda: bool(self.state.safety), STARTING_S):
            raise NoHandError(f"a driver runs in {self.namespace}, but no controller reports within {STARTING_S:g} s")

    def await_control(self) -> None:
        """Wait until the controller drives the hand. Raises NoHandError that says how to enable it."""
        self.await_hand()
        self.until(lambda: self.state.controlling or self.state.vented, STARTING_S)
        if not self.until(lambda: self.state.controlling, CANCEL_S):
            raise NoHandError(f"the hand does not move ({self.state.safety}); enable it with: hand enable [--reset]")

    def move(self, angle_rad: Mapping[str, float], duration_s: float) -> None:
        """Send angles [rad] of some joints as one trajectory of duration_s [s] with zero end velocity.

        Raises NoHandError where nobody listens.
        """
        trajectories = self._publisher(JointTrajectory, "joint_trajectory", ANSWER_S)
        if not trajectories.get_subscription_count():
            raise NoHandError(f"nobody listens to {self.namespace}/joint_trajectory")
        seconds = int(duration_s)
        point = JointTrajectoryPoint(
            positions=list(angle_rad.values()),
            velocities=[0.0] * len(angle_rad),
            time_from_start=Duration(sec=seconds, nanosec=round((duration_s - seconds) * 1e9)),
        )
        trajectories.publish(JointTrajectory(joint_names=list(angle_rad), points=[point]))

    def collect(self, joints: Sequence[str], site_joint: Mapping[str, int]) -> None:
        """From now on, keep every frame and the set-points of these joints in `samples`.

        site_joint: index of the joint that carries a force site, by the name of the site.
        """
        self.samples = Samples(tuple(joints), dict(site_joint))
        self._node.create_subscription(ValveCommand, "valve_command", self._on_command, STREAM_QOS)

    def command(self, angle_rad: Mapping[str, float], max_torque_nm: float = 0.0) -> None:
        """Send wanted angles [rad] of some joints, which the controller approaches at its own speed.

        max_torque_nm: of each of them; 0: the configured limit.
        """
        torque = [max_torque_nm] * len(angle_rad) if max_torque_nm > 0.0 else []
        commands = self._publisher(JointState, "joint_commands", CANCEL_S)
        commands.publish(JointState(name=list(angle_rad), position=list(angle_rad.values()), effort=torque))

    def _publisher(self, kind: Any, topic: str, timeout_s: float) -> Publisher[Any]:
        """The publisher of a topic, made when it is first needed: a policy of SROS2 then need not allow the others.

        A new one waits at most timeout_s [s] for a listener; what is published before would be lost.
        """
        if topic not in self._publishers:
            made = self._publishers[topic] = self._node.create_publisher(kind, topic, QUEUED_QOS)
            self.until(lambda: made.get_subscription_count() > 0, timeout_s)
        return self._publishers[topic]

    def others(self) -> list[str]:
        """Names of the other nodes in the namespace of the hand, as far as they are known yet."""
        names = [name for name, space in self._node.get_node_names_and_namespaces() if space == self.namespace]
        if self._node.get_name() in names:
            names.remove(self._node.get_name())  # one of them is this client; there may be another of the same name
        return names

    def listens(self, name: str) -> bool:
        """Whether a node of this name receives joint_states, as far as it is known yet."""
        found = self._node.get_subscriptions_info_by_topic(f"{self.namespace}/joint_states")
        return any((info.node_namespace, info.node_name) == (self.namespace, name) for info in found)

    def hold(self, joints: Sequence[str]) -> None:
        """End the motion of some joints where they are, and wait until that is sent: at most CANCEL_S."""
        trajectories = self._publisher(JointTrajectory, "joint_trajectory", CANCEL_S)
        trajectories.publish(JointTrajectory(joint_names=list(joints)))
        trajectories.wait_for_all_acked(rclpy.duration.Duration(seconds=CANCEL_S))

    def grasp(
        self, pattern: str, closure: float, max_torque_nm: float, healthy: Callable[[], None]
    ) -> tuple[bool, str]:
        """Run the action to its end: whether it succeeded, and its message. closure [-]: 0 open, 1 closed.

        healthy is called all the time and may raise; then the goal is cancelled. Raises NoHandError.
        """
        self._actions = self._actions or [ActionClient(self._node, Grasp, "grasp")]
        (action,) = self._actions
        if not self.until(action.server_is_ready, ANSWER_S):
            raise NoHandError(f"nobody offers the action {self.namespace}/grasp")
        goal = Grasp.Goal(pattern=pattern, closure=closure, max_torque=max_torque_nm)
        handle = self._wait(action.send_goal_async(goal))
        if not handle.accepted:
            self.until(lambda: self.state.statuses.get("controller: commands", (0, ""))[0] > 0, CANCEL_S)
            return False, self.state.statuses.get("controller: commands", (0, "the grasp was refused"))[1]
        future = handle.get_result_async()
        try:
            while not future.done():
                self.spin(TICK_S)
                healthy()
        except BaseException:
            self.until(handle.cancel_goal_async().done, CANCEL_S)
            raise
        answer = future.result()
        return answer.status == GoalStatus.STATUS_SUCCEEDED, answer.result.message

    def stop(self) -> None:
        """Emergency stop: publish until driver and controller report it. Raises NoHandError where none of them does."""
        for _ in range(round(RUNNING_S / 0.1)):
            self._stop.publish(Empty())
            if self.until(self._stopped, 0.1) and self._stop.get_subscription_count():
                return
        if self._stop.get_subscription_count() == 0:
            raise NoHandError(f"no hand runs in {self.namespace}; nothing received the emergency stop")
        raise NoHandError(f"the emergency stop was sent, but {self.namespace} does not confirm it")

    def send_stop(self) -> None:
        """Publish one emergency stop and do not wait; `stop` waits for its confirmation."""
        self._stop.publish(Empty())

    def vent(self) -> tuple[bool, str]:
        """Vent the hand without latching a fault; success and the answer. Raises NoHandError."""
        answer = self._call(Trigger, "vent", Trigger.Request())
        return bool(answer.success), str(answer.message)

    def _stopped(self) -> bool:
        """Whether every node that reports its safety has latched a fault: this stop, or one that came before it."""
        levels = [level for name, (level, _) in self.state.statuses.items() if name.endswith(": safety")]
        return bool(levels) and all(level == ERROR for level in levels)

    def enable(self, reset: bool) -> tuple[bool, str]:
        """Enable the controller, after clearing latched faults where reset is true; success and the answer."""
        self.await_hand()
        if reset:
            for name in ("reset_driver", "reset"):
                self._call(Trigger, name, Trigger.Request())  # without a latched fault it answers that there is none
            self.until(lambda: "call reset" not in self.state.safety, CANCEL_S)
        answer = self._call(SetBool, "enable", SetBool.Request(data=True))
        return bool(answer.success), str(answer.message)

    def _call(self, kind: Any, name: str, request: Any) -> Any:
        if name not in self._services:
            self._services[name] = self._node.create_client(kind, name)
        client = self._services[name]
        if not self.until(client.service_is_ready, ANSWER_S):
            raise NoHandError(f"nobody offers the service {self.namespace}/{name}")
        call = RepeatedCall(lambda: client.call_async(request), AGAIN_S)
        if not self.until(call.answered, ANSWER_S):
            raise NoHandError(f"{self.namespace}/{name} does not answer within {ANSWER_S:g} s")
        return call.answer()

    def _wait(self, future: Future) -> Any:
        if not self.until(future.done, ANSWER_S):
            raise NoHandError(f"{self.namespace} does not answer within {ANSWER_S:g} s")
        return future.result()

    def _on_joints(self, message: JointState) -> None:
        stamp_ns = _ns(message.header.stamp)
        self.state.frame(message.name, message.position, stamp_ns, self._node.get_clock().now().nanoseconds)
        if self.samples is not None:
            self.samples.angles(stamp_ns, message.name, message.position)

    def _on_pressures(self, message: JointPressures) -> None:
        self.state.take("pressure", message.name, message.pressure)
        if self.samples is not None:
            self.samples.pressures(_ns(message.header.stamp), message.name, message.pressure)

    def _on_command(self, message: ValveCommand) -> None:
        if self.samples is not None:
            lifetime_ns = _ns(message.lifetime)
            self.samples.command(_ns(message.header.stamp), lifetime_ns, message.name, message.pressure)

    def _on_forces(self, message: ContactForces) -> None:
        self.state.take("force", message.name, message.force)
        if self.samples is not None:
            self.samples.forces(_ns(message.header.stamp), message.name, message.force)

    def _on_state(self, message: ControllerState) -> None:
        for name in ("reference", "pressure_command", "torque_estimate", "contact"):
            self.state.take(name, message.name, getattr(message, name))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        start = f"{self.namespace}/"
        for status in message.status:
            if status.name.startswith(start):
                self.state.statuses[status.name.removeprefix(start)] = (status.level[0], status.message)


def _ns(time: Any) -> int:
    """Nanoseconds of a Time or a Duration."""
    return int(time.sec) * 1_000_000_000 + int(time.nanosec)
