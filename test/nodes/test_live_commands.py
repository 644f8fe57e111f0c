"""`hand up`, `move`, `grasp`, `watch`, `stop` and `enable` as a user types them, on one simulated hand over DDS."""

from __future__ import annotations

import json
import math
import os
import re
import signal
import subprocess
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from hand_model.description import load_hand
from hand_model.geometry import link_poses
from hand_recording.installed import default_model
from hand_recording.message_types import definition
from hand_robot.urdf import BASE
from test.nodes.stack import TOOL, WAIT_S, Client, Stack, Started
from test.repeating import STALLED, TRIES, again_after_a_stall

LATCHED_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
Answer = tuple[int, str, str]
RATE_HZ = 100
"""Half of the described rate: here commands are tested, and each takes seconds of a processor next to the hand."""


class Terminal(Stack):
    """Runs commands of the tool; `hand up --sim` runs from the start."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.client = Client()
        self.begun: list[subprocess.Popen[str]] = []
        model = folder / "hand.yaml"
        described = default_model().read_text(encoding="utf-8")
        assert "rate_hz: 200\n" in described
        model.write_text(described.replace("rate_hz: 200\n", f"rate_hz: {RATE_HZ}\n"), encoding="utf-8")
        self.up = self.start("hand", "up", "--sim", "--model", str(model))

    def ready(self) -> None:
        """Wait until the hand runs and is driven."""
        self.client.until(lambda: "/hand " in self.log("hand"), 120.0)  # kernels may have to be compiled
        self.enable()
        running = re.compile(r"^simulation and controller of 11 joints run in /hand at \d+ Hz: controlling$", re.M)
        self.client.until(lambda: running.search(self.log("hand")))

    def begin(self, *words: str) -> subprocess.Popen[str]:
        environment = os.environ | {"ROS_HOME": str(self.folder), "COLUMNS": "80"}
        pipe = subprocess.PIPE
        self.begun.append(subprocess.Popen([*TOOL, *words], stdout=pipe, stderr=pipe, text=True, env=environment))
        return self.begun[-1]

    def hand(self, *words: str) -> Answer:
        return end(self.begin(*words))

    def vented_by_a_stall(self) -> str:
        """The present status of a controller that has vented for lack of data; empty otherwise."""
        self.client.spin(1.1)  # statuses come at 1 Hz
        return next((line for line in STALLED if self.client.said("controller", "safety", line)), "")

    def begin_again(self) -> None:
        """The hand goes on to run, and is driven again; a command that a failed try has left ends."""
        for process in self.begun:
            if process.returncode is None:
                process.kill()
                process.communicate()
        self.begun.clear()
        self.enable()

    def enable(self) -> None:
        """Drive the hand again where a machine that stalled has made it vent."""
        self.client.spin(0.2)
        for _ in range(TRIES):
            if self.client.said("controller", "safety", "controlling"):
                break
            self.client.trigger("reset_driver")
            self.client.trigger("reset")
            self.client.enable(True)
            self.client.spin(1.1)  # statuses come at 1 Hz
        self.client.controlling()

    def interrupt(self, condition: Callable[[], bool], *words: str) -> Answer:
        """Run a command and press Ctrl-C as soon as the condition holds."""
        process = self.begin(*words)
        self.client.until(condition)
        process.send_signal(signal.SIGINT)
        return end(process)


def end(process: subprocess.Popen[str]) -> Answer:
    out, err = process.communicate(timeout=WAIT_S)
    assert "Traceback" not in err, err
    return process.returncode, out, err


def children(process: Started) -> list[int]:
    text = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text(encoding="utf-8")
    return [int(pid) for pid in text.split()]


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Terminal]:
    made = Terminal(tmp_path_factory.mktemp("live"))
    try:
        made.ready()
        yield made
    finally:
        made.stop_all()
        made.client.close()


@pytest.fixture
def terminal(live: Terminal) -> Terminal:
    """The hand, which is driven."""
    live.enable()
    return live


@again_after_a_stall
def test_move_puts_joints_where_the_user_asked(terminal: Terminal) -> None:
    """Fails when another joint moves, the wrong unit is sent, or the command ends before the joint is there."""
    code, out, err = terminal.hand("move", "index_proximal=0.8", "ring_distal=30deg", "--duration", "0.5", "--json")
    assert code == 0, err
    answer = json.loads(out)
    assert answer["model_file"]["path"].endswith("hand.yaml")
    assert answer["arrived"] and answer["wanted_rad"]["ring_distal"] == pytest.approx(0.5236, abs=1e-4)
    terminal.client.spin(0.2)
    assert terminal.client.angle("index_proximal") == pytest.approx(0.8, abs=0.06)
    assert terminal.client.angle("ring_distal") == pytest.approx(0.5236, abs=0.06)
    assert abs(terminal.client.angle("middle_proximal")) < 0.2


@again_after_a_stall
def test_what_cannot_be_asked_is_one_line(terminal: Terminal) -> None:
    """Fails when a wrong request moves the hand, ends with another code than 2 (1: refused), or takes two lines."""
    for words, code, part in (
        (("move", "index_proximal=9"), 2, "hand move: index_proximal is 9; the allowed range is -0.175 to"),
        (("move", "idex_proximal=0.8"), 2, "did you mean index_proximal?"),
        (("move", "index_proximal=0.8", "--duration", "0"), 2, "--duration is 0; the allowed range is 0.1 to 60 s"),
        (("grasp", "tripood"), 1, "pattern is 'tripood'; it must be one of open,"),
        (("up", "--sim"), 2, "hand up: a hand runs already in /hand"),
    ):
        terminal.enable()
        ended, out, err = terminal.hand(*words)
        lines = [line for line in err.splitlines() if not line.startswith("model: ")]
        assert (ended, out, len(lines)) == (code, "", 1) and part in lines[0], (words, ended, out, err)


def test_a_hand_that_is_not_there_is_named_with_what_starts_it(terminal: Terminal) -> None:
    """Fails when a command waits for ever for a hand, or does not say how to start one."""
    begun = time.monotonic()
    running = [terminal.begin(name, "--namespace", "nobody") for name in ("watch", "stop")]
    (code, _, err), (stop_code, _, stop_err) = map(end, running)
    assert (code, err) == (2, "hand watch: no hand runs in /nobody; start one with: hand up --sim\n")
    assert (stop_code, stop_err) == (2, "hand stop: no hand runs in /nobody; nothing received the emergency stop\n")
    assert time.monotonic() - begun < 15.0


@again_after_a_stall
def test_watch_shows_whole_names_in_80_columns(terminal: Terminal) -> None:
    """Fails when a name is cut, a joint is missing, or the safety is not shown."""
    code, out, err = terminal.hand("watch", "--duration", "1")
    assert code == 0, err
    names = {match[1] for match in re.finditer(r"^ *(\w+) +-?\d+\.\d +-?\d+\.\d ", out, re.MULTILINE)}
    assert names == set(terminal.client.joints[-1].name)
    assert "/hand: controlling" in out and max(map(len, out.splitlines())) <= 80


@again_after_a_stall
def test_ctrl_c_ends_move_grasp_and_watch_in_order(terminal: Terminal) -> None:
    """Fails when the code is not 130, a motion or a grasp goes on, or the hand is vented by it."""
    client = terminal.client
    code, _, err = terminal.hand("move", "index_proximal=0", "--duration", "0.5")
    assert code == 0, err
    client.until(lambda: client.angle("index_proximal") < 0.1)  # older messages may still wait to be received
    code, _, err = terminal.interrupt(
        lambda: client.angle("index_proximal") > 0.3, "move", "index_proximal=1.4", "--duration", "4"
    )
    assert code == 130 and err.endswith("hand move: interrupted; nothing was written\n"), err
    before = math.inf
    while abs(client.angle("index_proximal") - before) > 0.02:  # a motion that goes on ends at 1.4
        before = client.angle("index_proximal")
        client.spin(0.5)
    assert 0.3 < client.angle("index_proximal") < 1.3

    start = client.angle("index_proximal")
    code, _, err = terminal.interrupt(lambda: abs(client.angle("index_proximal") - start) > 0.1, "grasp", "tripod")
    assert code == 130 and "interrupted" in err
    assert client.said("controller", "safety", "controlling")
    process = terminal.begin("watch", "--json")
    assert process.stdout is not None and json.loads(process.stdout.readline())["safety"] == "controlling"
    process.send_signal(signal.SIGINT)
    assert end(process)[0] == 130


@again_after_a_stall
def test_stop_vents_until_it_is_enabled_again(terminal: Terminal) -> None:
    """Fails when pressure is commanded after a stop, a move is accepted then, or --reset does not clear it."""
    client = terminal.client
    code, _, err = terminal.hand("move", "middle_proximal=0.6", "--duration", "0.3")
    assert code == 0, err
    code, out, err = terminal.hand("stop")
    assert (code, err) == (0, "") and "hand enable --reset" in out
    client.until(lambda: max(client.valves[-1].pressure) == 0.0)
    code, _, err = terminal.hand("move", "middle_proximal=0.3")
    assert code == 2 and "emergency stop" in err and err.count("\n") == 2  # which model, and why not
    assert "enable it with: hand enable [--reset]" in err
    code, out, err = terminal.hand("enable", "--reset")
    assert (code, out, err) == (0, "enabled\n", "")
    client.until_said("controller", "safety", "controlling")


def latched(client: Client, kind: Any, topic: str) -> list[Any]:
    """What a subscriber receives that comes late and asks for what was published before."""
    received: list[Any] = []
    client.node.create_subscription(kind, topic, received.append, LATCHED_QOS)
    client.until(lambda: received)
    return received


@again_after_a_stall
def test_viewers_get_the_description_and_the_frames_of_the_hand(terminal: Terminal) -> None:
    """Fails when a late viewer gets no description, a frame is elsewhere than the joints say, or a bag lacks the type.

    The transforms are combined here and compared with the forward kinematics of the model.
    """
    client = terminal.client
    (text,) = latched(client, String, "robot_description")
    moving = {joint.get("name") for joint in ET.fromstring(text.data).iter("joint") if joint.get("type") == "revolute"}
    assert moving == set(client.joints[-1].name)
    code, _, err = terminal.hand("move", "index_proximal=0.8", "--duration", "0.3")
    assert code == 0, err
    (still,) = latched(client, TFMessage, "/tf_static")
    moved: list[Any] = []
    client.node.create_subscription(TFMessage, "/tf", moved.append, 50)
    client.joints.clear()
    frames, joints = in_one_moment(client, moved)
    angle = dict(zip(joints.name, joints.position, strict=True))
    hand = load_hand(default_model())
    expected = link_poses(hand, np.array([angle[joint] for joint in hand.joints]))
    poses = {BASE: np.eye(4)}
    for transform in (*still.transforms, *frames.transforms, *still.transforms):  # parents come first
        if transform.header.frame_id in poses:
            poses[transform.child_frame_id] = poses[transform.header.frame_id] @ matrix(transform.transform)
    assert poses.keys() - {BASE} == expected.keys()
    for name, pose in expected.items():
        np.testing.assert_allclose(poses[name][:3, 3], pose[:3, 3], atol=1e-6, err_msg=name)
    (info,) = client.node.get_publishers_info_by_topic("/tf")
    assert str(info.topic_type_hash) == definition("tf2_msgs/msg/TFMessage").type_hash


def in_one_moment(client: Client, moved: list[TFMessage]) -> tuple[TFMessage, JointState]:
    """The first frames and joint states of one stamp; a client that comes late loses either of some stamps."""
    found: list[tuple[TFMessage, JointState]] = []

    def arrived() -> bool:
        joints = {(m.header.stamp.sec, m.header.stamp.nanosec): m for m in client.joints}
        stamps = [(m, m.transforms[0].header.stamp) for m in moved]
        found.extend((m, joints[s.sec, s.nanosec]) for m, s in stamps if (s.sec, s.nanosec) in joints)
        return bool(found)

    client.until(arrived)
    return found[0]


def matrix(transform: Any) -> Any:
    """A transform of TF as a homogeneous matrix (4, 4)."""
    place, turn = transform.translation, transform.rotation
    made = np.eye(4)
    made[:3, :3] = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
    made[:3, 3] = place.x, place.y, place.z
    return made


def test_only_one_node_publishes_the_description(terminal: Terminal) -> None:
    """Fails when the hand's own description stays next to that of a robot_state_publisher, or does not come back."""
    client, topic = terminal.client, "/hand/robot_description"
    client.until(lambda: client.node.count_publishers(topic) == 1)
    other = client.node.create_publisher(String, topic, LATCHED_QOS)
    client.until(lambda: [info.node_name for info in client.node.get_publishers_info_by_topic(topic)] == ["client"])
    client.until_said("frame_publisher", "frames", "client publishes robot_description")
    assert client.node.count_publishers("/tf") == client.node.count_publishers("/tf_static") == 0
    client.node.destroy_publisher(other)
    client.until(lambda: client.node.count_publishers(topic) == client.node.count_publishers("/tf") == 1)


@pytest.mark.long
def test_up_runs_a_board_on_a_serial_line(stack: Stack, terminal: Terminal) -> None:
    """Fails when `hand up --serial` needs anything but a port, or drives a real hand without being asked."""
    path = stack.folder / "board"
    stack.start("hand", "emulate-board", "--serial", str(path))
    terminal.client.until(lambda: "ready" in stack.log("hand"))
    process = terminal.begin("up", "--serial", str(path), "--namespace", "other")
    assert process.stdout is not None
    line = process.stdout.readline()
    process.send_signal(signal.SIGINT)
    code, _, err = end(process)
    assert code == 0, err
    assert re.fullmatch(r"driver and controller of 11 joints run in /other at \d+ Hz: vented: not enabled\n", line)


@pytest.mark.long
def test_sigterm_ends_a_hand_that_a_script_started_in_the_background(terminal: Terminal) -> None:
    """Fails when `hand up` ignores SIGTERM where its caller ignores SIGINT, as a shell script does with `&`."""
    command = " ".join([*TOOL, "up", "--sim", "--namespace", "behind"])
    domain = str((int(os.environ["ROS_DOMAIN_ID"]) + 1) % 100)  # the hand of the other tests is not to be heard
    environment = os.environ | {"ROS_HOME": str(terminal.folder / "behind"), "ROS_DOMAIN_ID": domain}
    started = ["bash", "-c", f"trap '' INT; exec {command}"]
    process = subprocess.Popen(started, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
    assert process.stdout is not None
    assert "run in /behind" in process.stdout.readline()
    process.terminate()
    code, _, err = end(process)
    assert code == 0 and err.endswith("hand up: vented, nodes ended\n")


def test_ctrl_c_ends_the_hand_that_up_started(terminal: Terminal) -> None:
    """Fails when a node survives `hand up`, the last command is not 0 Pa, or nodes do not say that they run."""
    client, nodes = terminal.client, children(terminal.up)
    assert len(nodes) == 3  # simulation, controller, frame_publisher
    assert terminal.stop(terminal.up) == 0
    assert client.last_pressure_pa() == 0.0
    assert not any(Path(f"/proc/{pid}").exists() for pid in nodes)
    assert terminal.log("hand").endswith("hand up: vented, nodes ended\n")
