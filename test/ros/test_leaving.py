"""Programs leave the ROS graph before they end."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
import rclpy

from hand_ros import node
from hand_ros.transport import FROM_FILE, ONLY_LOCAL, PEERS, PROFILES, RANGE

THREADS = """
from pathlib import Path
names = [path.read_text().strip() for path in Path("/proc/self/task").glob("*/comm")]
print(sorted(name for name in names if name.startswith("dds.") and name != "dds.shm.wdog"))
"""
"""Prints the threads of the DDS participants of this process; one of shared memory belongs to none of them."""
NODE = """
import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.task import Future
from std_msgs.msg import Empty
from hand_ros.node import leave_graph
rclpy.init()
node, executor, come = rclpy.create_node("passer_by"), EventsExecutor(), []
executor.add_node(node)
node.create_subscription(Empty, "heard", come.append, 10)
publisher = node.create_publisher(Empty, "heard", 10)
while not come:
    publisher.publish(Empty())
    executor.spin_until_future_complete(Future(), timeout_sec=0.05)
leave_graph(node, executor)
"""
LIFECYCLE_NODE = """
import rclpy
from hand_ros.node import HandNode
rclpy.init()
node = HandNode("passer_by", ())
node.destroy_node()
rclpy.try_shutdown()
"""
CLIENT = """
from hand_client import node
node.ANSWER_S = 0.1
with node.HandClient("nobody") as client:
    client.spin(0.1)
    for ask in (client.vent, lambda: client.grasp("open", 1.0, 0.0, lambda: None)):
        try:
            ask()
        except node.NoHandError:
            continue
        raise SystemExit("somebody answers")
"""


HANGING = """
from hand_ros import node
class Hanging(node.HandNode):
    def finish(self):
        while True:
            pass
node.ENDS_S = 0.3
node.end(node.run(lambda: Hanging("hanging", (node.STATE_FILE,))))
"""


@pytest.mark.parametrize(
    "program", [NODE, LIFECYCLE_NODE, CLIENT], ids=["node", "node of the hand", "client of the hand"]
)
def test_no_participant_is_left_to_the_end_of_the_program(program: str) -> None:
    """Fails when a participant still lives when a program has left the graph: to end it later may crash Fast DDS."""
    ended = subprocess.run(
        [sys.executable, "-c", program + THREADS], capture_output=True, text=True, timeout=60, check=True
    )
    assert ended.stdout == "[]\n"


def test_a_node_that_hangs_at_its_end_says_where_and_ends() -> None:
    """Fails when a node whose end takes for ever stays, or ends without a line of where it was."""
    command = [sys.executable, "-c", HANGING, "--ros-args", "-p", "exit_unconfigured:=true"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 1 and "in finish" in ended.stderr


@pytest.mark.parametrize(
    ("middleware", "range_"), [("rmw_cyclonedds_cpp", "LOCALHOST"), ("rmw_fastrtps_cpp", "SYSTEM_DEFAULT")]
)
def test_profiles_of_fast_dds_are_for_fast_dds_alone(
    middleware: str, range_: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fails when a program under another middleware no longer stays on this machine, where the user asked for that."""
    ours = {*PROFILES, FROM_FILE, PEERS, ONLY_LOCAL}
    environment = {key: value for key, value in os.environ.items() if key not in ours} | {RANGE: "LOCALHOST"}
    monkeypatch.setattr(os, "environ", environment)
    monkeypatch.setattr(node, "get_rmw_implementation_identifier", lambda: middleware)
    monkeypatch.setattr(rclpy, "init", lambda **_: None)
    node.join_graph([])
    assert environment[RANGE] == range_ and (PROFILES[0] in environment) == (range_ != "LOCALHOST")
