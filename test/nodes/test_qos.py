"""What subscribers with default and with transient-local QoS receive, and what a healthy node logs."""

from __future__ import annotations

import os
import re
import resource
from pathlib import Path
from typing import TYPE_CHECKING, Any

from diagnostic_msgs.msg import DiagnosticArray
from hand_msgs.msg import AdcFrame, BoardState, Contact, ContactForces, ControllerState, JointPressures, ValveCommand
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from test.nodes.viewer_paths import DIAGNOSTICS, check_foxglove, check_plotjuggler, joined

if TYPE_CHECKING:
    from test.nodes.stack import Client, Stack

TOPICS = {
    "adc": AdcFrame,
    "board_state": BoardState,
    "contact_forces": ContactForces,
    "controller_state": ControllerState,
    "joint_states": JointState,
    "pressures": JointPressures,
    "valve_command": ValveCommand,
}
LATE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def test_every_topic_reaches_a_default_subscriber_and_late_ones_get_the_last_state(
    stack: Stack, client: Client
) -> None:
    """Fails when a topic is published best effort, a late subscriber gets no state, or a healthy node is silent.

    It also fails when a layout of Foxglove or PlotJuggler shows a signal that the messages do not have.
    """
    received: dict[str, list[Any]] = {topic: [] for topic in TOPICS}
    for topic, kind in TOPICS.items():
        client.node.create_subscription(kind, topic, received[topic].append, 10)
    seen: dict[str, Any] = {}
    client.node.create_subscription(String, "robot_description", lambda m: seen.update({"robot_description": m}), LATE)
    statuses: list[Any] = []
    client.node.create_subscription(DiagnosticArray, "/diagnostics", lambda m: statuses.extend(m.status), 10)
    stack.node("simulation")
    stack.node("controller")
    stack.node("frame_publisher")
    client.controlling()
    client.until(lambda: min(len(messages) for messages in received.values()) >= 3 and seen)
    assert {messages[-1].header.frame_id for messages in received.values()} == {"palm"}
    newest = {f"/hand/{topic}": messages[-1] for topic, messages in received.items()}
    newest |= {"/hand/robot_description": seen["robot_description"], DIAGNOSTICS: joined(statuses)}
    check_foxglove(newest)
    check_plotjuggler(newest)
    spaces = [name for name, _ in client.node.get_topic_names_and_types() if name.startswith("/hand/")]
    publishers = [info for name in spaces for info in client.node.get_publishers_info_by_topic(name)]
    own = [info for info in publishers if info.node_name in ("simulation", "controller")]
    assert len(own) > len(TOPICS)
    assert {info.qos_profile.reliability for info in own} == {ReliabilityPolicy.RELIABLE}
    recorder = stack.start("recorder", "--ros-args", "-r", "__ns:=/hand", "-p", f"out:={stack.folder / 'healthy.mcap'}")
    lines_of = {
        "simulation": r"simulation of 11 joints runs in /hand at \d+ Hz; ",
        "controller": r"controller of 11 joints runs in /hand at \d+ Hz; ",
        "frame_publisher": r"frame_publisher of 11 joints runs in /hand at \d+ Hz$",
        "recorder": r"recorder of \d+ topics runs in /hand at \d\d+ messages/s, into .*healthy\.mcap$",
    }
    for name, words in lines_of.items():
        line = re.compile(rf" healthy: {words}", re.MULTILINE)
        client.until(lambda name=name, line=line: line.search(stack.log(name)))  # type: ignore[misc]
        lines = stack.log(name).splitlines()
        outages = sum("[ERROR]" in line for line in lines)  # of a machine that stalls
        assert 1 <= sum(" healthy: " in line for line in lines) <= 1 + outages, stack.log(name)
    assert "not healthy" not in stack.log("recorder") and stack.stop(recorder) == 0

    request = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_DEACTIVATE))
    assert client.call(ChangeState, "simulation/change_state", request).success
    client.spin(0.3)
    late: dict[str, list[Any]] = {"joint_states": [], "board_state": []}
    for topic, messages in late.items():
        client.node.create_subscription(TOPICS[topic], topic, messages.append, LATE)
    client.until(lambda: all(late.values()))
    contacts: list[Any] = []
    client.node.create_subscription(Contact, "contacts", contacts.append, LATE)
    (offered,) = client.node.get_publishers_info_by_topic("/hand/contacts")
    assert offered.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL


def test_two_hands_have_frames_of_their_own(stack: Stack, client: Client) -> None:
    """Fails when a hand in another namespace claims the frame of the first one, or a node takes long to end."""
    states: list[Any] = []
    client.node.create_subscription(JointState, "/left_hand/joint_states", states.append, 10)
    node = stack.start("simulation", "--ros-args", "-r", "__ns:=/left_hand")
    client.until(lambda: states)
    assert states[-1].header.frame_id == "left_hand/palm"
    before_s, children = _cpu_s(node.pid), resource.getrusage(resource.RUSAGE_CHILDREN)
    assert stack.stop(node) == 0
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    lived_s = after.ru_utime + after.ru_stime - children.ru_utime - children.ru_stime
    assert lived_s - before_s < 0.3  # 0.65 s where Python frees the compiled code


def _cpu_s(pid: int) -> float:
    """Time of the processor [s] that a running process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
