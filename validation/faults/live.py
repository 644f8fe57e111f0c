"""The nodes as processes, and a node of a user that commands and observes them: for the families in real time."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from hand_msgs.msg import BoardState, JointPressures, ValveCommand
from rclpy.action import ActionClient
from rclpy.experimental import EventsExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from hand_client.repeated_call import RepeatedCall
from hand_control.inputs import JointInput
from hand_driver.board import Status
from hand_messages.layouts import JOINT_PRESSURES, JOINT_STATE, VALVE_COMMAND
from hand_ros.node import QUEUED_QOS, STATE_QOS, leave_graph
from hand_tool.processes import executable
from validation.faults.closed_loop import description

WAIT_S = 120.0
"""Longest wait for nodes to start and to find each other."""
AGAIN_S = 2.0
SPIN_S = 0.005
STOP_S = 20.0
MOVING_DEG = (15.0, 55.0)
Started = subprocess.Popen[bytes]


class TooLateError(RuntimeError):
    """What was waited for has not come; the message is one line."""


class Nodes:
    """Context manager of named processes, each with a log; all of them are ended at its end."""

    def __init__(self, folder: Path) -> None:
        """Write the logs to folder/NAME.log."""
        self.folder = folder
        self.running: dict[str, Started] = {}
        self._commands: dict[str, Sequence[str]] = {}

    def __enter__(self) -> Nodes:
        """Make the folder."""
        self.folder.mkdir(parents=True, exist_ok=True)
        return self

    def __exit__(self, kind: type[BaseException] | None, _: BaseException | None, __: TracebackType | None) -> None:
        """End every process: by SIGINT, after STOP_S by SIGKILL."""
        for name in reversed(list(self.running)):
            self.end(name)

    def node(self, name: str, *before: str, **parameters: object) -> Started:
        """Start an executable of the stack with parameters; before: words in front of its command."""
        if name != "recorder":  # a fault that is latched here must not stay latched on this machine
            parameters.setdefault("state_file", self.folder / f"{name}.fault")
        pairs = [part for key, value in parameters.items() for part in ("-p", f"{key}:={value}")]
        return self.start(name, [*before, str(executable(name)), "--ros-args", *pairs])

    def module(self, name: str, *arguments: str) -> Started:
        """Start a Python module under the last part of its name."""
        return self.start(name.rpartition(".")[2], [sys.executable, "-m", name, *arguments])

    def start(self, name: str, command: Sequence[str]) -> Started:
        """Start any command under a name."""
        with (self.folder / f"{name}.log").open("ab") as log:
            self.running[name] = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, cwd=self.folder)
        self._commands[name] = command
        return self.running[name]

    def restart(self, name: str) -> Started:
        """Start the command of a name again; its process must have ended."""
        self.running[name].wait(STOP_S)
        return self.start(name, self._commands[name])

    def send(self, name: str, number: signal.Signals) -> None:
        """Send a signal to a process."""
        self.running[name].send_signal(number)

    def end(self, name: str) -> int:
        """End a process by SIGINT and return its exit code."""
        process = self.running.pop(name)
        if process.poll() is None:
            process.send_signal(signal.SIGCONT)
            process.send_signal(signal.SIGINT)
        try:
            return process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            return process.wait(STOP_S)

    def log(self, name: str) -> str:
        """What a process has printed."""
        return (self.folder / f"{name}.log").read_text(encoding="utf-8", errors="replace")


def cpu_s(process: Started) -> float:
    """CPU time of a process so far [s]."""
    fields = Path(f"/proc/{process.pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def rss_mb(process: Started) -> float:
    """Resident memory of a process [MB]."""
    pages = int(Path(f"/proc/{process.pid}/statm").read_text(encoding="utf-8").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") * 1e-6


class User:
    """A node of a user: it commands the hand and records what it publishes."""

    def __init__(self, depth: int = 100) -> None:
        """Join the graph; depth: length of the queues of what is received."""
        every = QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE)
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self.node = rclpy.create_node("campaign", namespace="hand")
        self._executor = EventsExecutor()
        self._executor.add_node(self.node)
        self._actions: list[ActionClient[Any, Any, Any]] = []
        joints = description().joints
        self._states = JointInput(JOINT_STATE, joints, ("position",))
        self._pressures = JointInput(JOINT_PRESSURES, joints, ("pressure",))
        self._valves = JointInput(VALVE_COMMAND, joints, ("pressure",))
        self.angle_rad = np.full(len(joints), np.nan)
        self.pressure_pa = np.full(len(joints), np.nan)
        self.stamps_ns: list[int] = []
        self.answered_ns: list[int] = []
        self.pressures_ns: list[int] = []
        self.board: BoardState | None = None
        self.board_at_s = self.frame_at_s = self.command_at_s = -1.0
        self.commanded_pa = 0.0
        self.worst_pa = self.worst_set_point_pa = 0.0
        self.statuses: dict[str, tuple[int, str]] = {}
        create = self.node.create_subscription
        create(JointState, "joint_states", self._on_states, every, raw=True)
        create(JointPressures, "pressures", self._on_pressures, every, raw=True)
        create(ValveCommand, "valve_command", self._on_valves, every, raw=True)
        create(BoardState, "board_state", self._on_board, STATE_QOS)
        create(DiagnosticArray, "/diagnostics", self._on_diagnostics, QUEUED_QOS)
        self._commands = self.node.create_publisher(JointState, "joint_commands", QUEUED_QOS)

    def _on_states(self, raw: bytes) -> None:
        try:
            stamp_ns, (self.angle_rad,) = self._states.read(raw)
        except ValueError:  # of another publisher
            return
        self.stamps_ns.append(stamp_ns)
        self.frame_at_s = time.monotonic()

    def _on_pressures(self, raw: bytes) -> None:
        try:
            stamp_ns, (self.pressure_pa,) = self._pressures.read(raw)
        except ValueError:  # of another publisher
            return
        self.pressures_ns.append(stamp_ns)
        self.worst_pa = max(self.worst_pa, float(np.nanmax(self.pressure_pa, initial=0.0)))

    def _on_valves(self, raw: bytes) -> None:
        try:
            stamp_ns, (pressure,) = self._valves.read(raw)
        except ValueError:  # of another publisher
            return
        self.answered_ns.append(stamp_ns)
        self.commanded_pa, self.command_at_s = float(pressure.max()), time.monotonic()

    def _on_board(self, message: BoardState) -> None:
        self.board, self.board_at_s = message, time.monotonic()
        if len(message.set_point):
            asked = np.array(message.set_point)
            self.worst_set_point_pa = max(self.worst_set_point_pa, float(np.nan_to_num(asked, nan=np.inf).max()))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.statuses[status.name] = (status.level[0], status.message)

    def spin(self, seconds: float) -> None:
        """Receive for `seconds` [s]."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._executor.spin_until_future_complete(Future(), timeout_sec=min(left, 0.05))

    def until(self, reached: Callable[[], Any], what: str, seconds: float = WAIT_S) -> float:
        """Receive until a condition holds; the time it took [s]. TooLateError after some seconds."""
        begun = time.monotonic()
        while not reached():
            if time.monotonic() - begun > seconds:
                raise TooLateError(f"{what} within {seconds:g} s; safety: {self.status('controller', 'safety')[1]}")
            self._executor.spin_until_future_complete(Future(), timeout_sec=SPIN_S)
        return time.monotonic() - begun

    def until_vented(self, at_s: float, seconds: float = 3.0) -> float:
        """Receive until a command of 0 Pa that came after at_s [s]; the time from at_s to it [s]."""
        self.until(lambda: self.commanded_pa == 0.0 and self.command_at_s > at_s, "the hand is not vented", seconds)
        return self.command_at_s - at_s

    def until_latched(self) -> None:
        """Receive until the controller reports a latched fault."""
        self.until(lambda: self.latched, "nothing is latched", 3.0)

    def status(self, node: str, part: str) -> tuple[int, str]:
        """Level and message of the newest diagnostics of a part of a node."""
        return self.statuses.get(f"/hand/{node}: {part}", (-1, "nothing on diagnostics"))

    def named(self, text: str) -> bool:
        """Whether a status of the level ERROR contains a text."""
        return any(level == 2 and text in line for level, line in self.statuses.values())

    @property
    def latched(self) -> bool:
        """Whether the controller reports a latched fault."""
        return "call reset" in self.status("controller", "safety")[1]

    @property
    def board_vented(self) -> bool:
        """Whether the newest state of the board has no set-points in force."""
        return self.board is not None and bool(self.board.status & Status.VENTED)

    def command(self, degrees: float) -> None:
        """Command all joints to an angle [deg]."""
        hand = description()
        target = np.clip(np.radians(degrees), hand.limits.low_rad, hand.limits.high_rad)
        self._commands.publish(JointState(name=list(hand.joints), position=target.tolist()))

    def call(self, kind: Any, name: str, request: Any) -> Any:
        """Call a service; its response. TooLateError where none comes."""
        client = self.node.create_client(kind, name)
        try:
            self.until(client.service_is_ready, f"the service {name} is not there")
            call = RepeatedCall(lambda: client.call_async(request), AGAIN_S)
            self.until(call.answered, f"the service {name} does not answer")
            return call.answer()
        finally:
            self.node.destroy_client(client)

    def enable(self) -> bool:
        """Enable the controller."""
        return bool(self.call(SetBool, "enable", SetBool.Request(data=True)).success)

    def trigger(self, name: str) -> bool:
        """Call a service without arguments."""
        return bool(self.call(Trigger, name, Trigger.Request()).success)

    def drive(self) -> None:
        """Reset and enable; wait until the hand is controlled and moves under pressure. Raises TooLateError."""
        self.until(lambda: time.monotonic() - self.frame_at_s < 0.05, "no joint states")
        self.until(lambda: self._commands.get_subscription_count() > 0, "nobody subscribes to joint_commands")
        end_s = time.monotonic() + WAIT_S
        while self.status("controller", "safety")[1] != "controlling":
            if time.monotonic() > end_s:
                raise TooLateError(f"the hand is not controlled: {self.status('controller', 'safety')[1]}")
            self.trigger("reset_driver")
            self.trigger("reset")
            self.enable()  # refused as long as a second publisher is there
            self.spin(0.5)
        self.motion()
        self.until(lambda: self.commanded_pa > 3e4 and self.pressure_pa.max() > 2e4, "the hand does not move", 10.0)

    def motion(self) -> None:
        """Command the other end of the motion."""
        low, high = MOVING_DEG
        self.command(high if np.degrees(self.angle_rad.mean()) < 0.5 * (low + high) else low)

    def action(self, kind: Any, name: str) -> ActionClient[Any, Any, Any]:
        """A client of an action, which ends with this node."""
        self._actions.append(ActionClient(self.node, kind, name))
        return self._actions[-1]

    def close(self) -> None:
        """Leave the graph."""
        leave_graph(self.node, self._executor, *self._actions)
