"""Real nodes in separate processes, and a client that communicates with them over DDS."""

from __future__ import annotations

import math
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

import rclpy
from ament_index_python.packages import get_package_prefix
from diagnostic_msgs.msg import DiagnosticArray
from hand_msgs.msg import ControllerState, ValveCommand
from lifecycle_msgs.srv import GetState
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

from hand_client.repeated_call import RepeatedCall
from hand_ros.node import join_graph, leave_graph
from test.repeating import STALLED

NODES = Path(get_package_prefix("fluidic_hand")) / "lib" / "fluidic_hand"
TOOL = (sys.executable, "-m", "hand_tool")
BEST_EFFORT = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
WAIT_S = 90.0
SOONER = ("nice", "-n", "-10")
"""The hand under test keeps deadlines, and the programs that command it take seconds of a processor to start."""
PRIORITY = () if subprocess.run([*SOONER, "true"], capture_output=True, check=False).stderr else SOONER
"""Nothing where this user may not raise a priority."""
HEARD_S = 3.0
"""Time in which nodes that have started together hear of each other; discovery takes up to 2.7 s."""
Started = subprocess.Popen[bytes]


class Stack:
    """Starts executables of the stack, and ends each of them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.running: list[Started] = []

    def start(self, name: str, *arguments: str) -> Started:
        return self._start(name, *PRIORITY, *(TOOL if name == "hand" else (str(NODES / name),)), *arguments)

    def module(self, name: str, *arguments: str) -> Started:
        """Start a Python module; its log has the last part of its name."""
        return self._start(name.rpartition(".")[2], sys.executable, "-m", name, *arguments)

    def _start(self, name: str, *command: str) -> Started:
        log = (self.folder / f"{name}.log").open("ab")
        environment = os.environ | {"ROS_HOME": str(self.folder)}  # a latched fault of an earlier test stays there
        process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, cwd=self.folder, env=environment)
        log.close()
        self.running.append(process)
        return process

    def node(self, name: str, **parameters: object) -> Started:
        """Start a node; a controller drives at once by default."""
        if name == "controller":
            parameters = {"enabled_at_start": "true"} | parameters
        pairs = [part for key, value in parameters.items() for part in ("-p", f"{key}:={value}")]
        return self.start(name, "--ros-args", *pairs)

    def log(self, name: str) -> str:
        return (self.folder / f"{name}.log").read_text(encoding="utf-8", errors="replace")

    def stop(self, process: Started, number: signal.Signals = signal.SIGINT) -> int:
        if process.poll() is None:
            process.send_signal(number)
        return process.wait(timeout=20)

    def stop_all(self) -> None:
        for process in reversed(self.running):
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        for process in self.running:
            try:
                process.wait(timeout=20)
            except subprocess.TimeoutExpired:
                process.kill()
                raise

    def vented_by_a_stall(self) -> str:
        """The line of the log with which the controller vented for lack of data; empty where it did not."""
        lines = [line for line in self.log("controller").splitlines() if "vented: " in line]
        return next((line for line in lines if any(reason in line for reason in STALLED)), "")

    def begin_again(self) -> None:
        """End every process, and forget their logs and latched faults."""
        self.stop_all()
        self.running.clear()
        for log in self.folder.glob("*.log"):
            log.unlink()
        shutil.rmtree(self.folder / "fluidic_hand", ignore_errors=True)


class Client:
    """A node of a user: it records the topics of the hand and sends commands."""

    def __init__(self) -> None:
        before = dict(os.environ)
        join_graph([])
        self.node = rclpy.create_node("client", namespace="hand")
        os.environ.clear()  # the processes under test choose their profiles themselves
        os.environ.update(before)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.actions: list[ActionClient[Any, Any, Any]] = []
        self.states: list[ControllerState] = []
        self.joints: list[JointState] = []
        self.valves: list[ValveCommand] = []
        self.statuses: dict[str, tuple[int, str]] = {}
        self.node.create_subscription(ControllerState, "controller_state", self.states.append, BEST_EFFORT)
        self.node.create_subscription(JointState, "joint_states", self.joints.append, 50)
        self.node.create_subscription(ValveCommand, "valve_command", self.valves.append, 50)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._diagnose, 50)
        self.commands = self.node.create_publisher(JointState, "joint_commands", 10)
        self.trajectories = self.node.create_publisher(JointTrajectory, "joint_trajectory", 10)

    @cached_property
    def valve_publisher(self) -> Any:
        """Made when first used: a second publisher makes the hand hold, then vent."""
        return self.node.create_publisher(ValveCommand, "valve_command", 1)

    def _diagnose(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.statuses[status.name] = (status.level[0], status.message)

    def until(self, condition: Callable[[], Any], timeout_s: float = WAIT_S) -> None:
        """Spin until the condition holds; fail after timeout_s [s]."""
        end = time.monotonic() + timeout_s
        while not condition():
            self.executor.spin_once(timeout_sec=0.05)
            assert time.monotonic() < end, f"condition not met in {timeout_s} s; diagnostics: {self.statuses}"

    def sending(self, send: Callable[[], Any], condition: Callable[[], Any]) -> None:
        """Send again and again until the condition holds, at 100 Hz at most.

        This node receives its own valve commands. A send after each message would be as fast as the machine allows,
        and the driver takes more than 2000 Hz for two publishers.
        """
        last_s = -math.inf

        def sent_and_met() -> bool:
            nonlocal last_s
            if time.monotonic() - last_s >= 0.01:
                last_s = time.monotonic()
                send()
            return bool(condition())

        self.until(sent_and_met)

    def spin(self, seconds: float) -> None:
        """Receive messages for some time [s]."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.05)

    def last_pressure_pa(self) -> float:
        """The largest set-point of the last valve command, once the one that sent them has ended; NaN without one.

        A node that was not served meanwhile has many messages to read, which takes a busy machine some time.
        """
        read = -1
        while read != len(self.valves):
            read = len(self.valves)
            self.spin(0.3)
        return max(self.valves[-1].pressure) if self.valves else math.nan

    def controlling(self) -> None:
        """Wait until the controller drives the hand."""
        self.until(lambda: self.said("controller", "safety", "controlling"))
        self.call(GetState, "controller/get_state", GetState.Request())  # it has heard of this client, too
        self.until(lambda: self.joints and self.valves and self.states)
        self.until(lambda: self.commands.get_subscription_count() > 0)
        self.until(lambda: self.trajectories.get_subscription_count() > 0)

    def said(self, node: str, part: str, text: str) -> bool:
        """Whether the present status of a node contains a text."""
        return text in self.statuses.get(f"/hand/{node}: {part}", (0, ""))[1]

    def until_said(self, node: str, part: str, text: str) -> None:
        self.until(lambda: self.said(node, part, text))

    def level(self, node: str, part: str) -> int:
        return self.statuses.get(f"/hand/{node}: {part}", (-1, ""))[0]

    def command(self, **angles: float) -> None:
        self.commands.publish(JointState(name=list(angles), position=list(angles.values())))

    def call(self, kind: Any, name: str, request: Any) -> Any:
        client = self.node.create_client(kind, name)
        assert client.wait_for_service(timeout_sec=WAIT_S)
        call = RepeatedCall(lambda: client.call_async(request), HEARD_S)
        self.until(call.answered)
        return call.answer()

    def heard(self) -> None:
        """Wait until every node has heard of every other one, which no node can ask for."""
        self.spin(HEARD_S)

    def trigger(self, name: str) -> Any:
        return self.call(Trigger, name, Trigger.Request())

    def enable(self, on: bool) -> Any:
        return self.call(SetBool, "enable", SetBool.Request(data=on))

    def angle(self, joint: str) -> float:
        """The newest measured angle [rad]."""
        message = self.joints[-1]
        return float(message.position[list(message.name).index(joint)])

    def begin_again(self) -> None:
        """Drop what was received so far."""
        self.spin(0.2)
        for messages in (self.states, self.joints, self.valves, self.statuses):
            messages.clear()

    def action(self, kind: Any, name: str) -> ActionClient[Any, Any, Any]:
        """A client of an action, which ends with this node."""
        self.actions.append(ActionClient(self.node, kind, name))
        return self.actions[-1]

    def close(self) -> None:
        """Leave the graph; fails where the DDS participant stays, which would listen to every later test."""
        leave_graph(self.node, self.executor, *self.actions)
        threads = [path.read_text().strip() for path in Path("/proc/self/task").glob("*/comm")]
        assert not any(name.startswith("dds.udp") for name in threads), threads
