"""The recorder as a separate process, with real publishers over DDS."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from hand_recording.loader import RecordingError, load_recording
from hand_recording.repair import repair
from test.waiting import until

TALKER = Path(__file__).with_name("talker.py")
RECORDER = [sys.executable, "-m", "hand_recording.node"]
LIMIT_S = 30.0

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed")


class Started:
    """A child process that is ended with SIGINT at the latest when the test is over."""

    def __init__(self, command: list[str], environment: dict[str, str], folder: Path) -> None:
        self.process = subprocess.Popen(
            command, env=environment, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    def wait_for(self, line: str) -> None:
        assert self.process.stdout
        assert self.process.stdout.readline().strip() == line

    def end(self, number: int = signal.SIGINT) -> tuple[int, str, str]:
        """Exit code and what was printed."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        out, err = self.process.communicate(timeout=LIMIT_S)
        return self.process.returncode, out, err


Start = Callable[[list[str]], Started]


@pytest.fixture
def start(ros_environment: dict[str, str], tmp_path: Path) -> Iterator[Start]:
    running: list[Started] = []

    def begin(command: list[str]) -> Started:
        running.append(Started(command, ros_environment, tmp_path))
        return running[-1]

    yield begin
    for process in running:
        process.end()


def _talker(start: Start, rate_hz: int, topics: int) -> Started:
    return start([sys.executable, str(TALKER), str(rate_hz), str(topics)])


def _recorder(start: Start, **parameters: str) -> Started:
    arguments = [item for name, value in parameters.items() for item in ("-p", f"{name}:={value}")]
    return start([*RECORDER, "--ros-args", *arguments])


@contextmanager
def _records(path: Path) -> Iterator[list[tuple[Any, Any, Any]]]:
    """Messages as mcap-ros2-support decodes them: channel, message, content."""
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        yield [(channel, message, content) for _, channel, message, content in reader.iter_decoded_messages()]


def test_killed_recorder_loses_less_than_a_second(start: Start, tmp_path: Path) -> None:
    """Breaks when kill -9 leaves a file that others cannot open, lacks more than its last second, or has holes."""
    talker, file = _talker(start, 200, 6), tmp_path / "out" / "out_0.mcap"
    recorder = _recorder(start, out="out")
    talker.wait_for("ready")
    until(lambda: file.exists() and file.stat().st_size > 150_000, LIMIT_S)
    killed_ns = time.time_ns()
    recorder.process.kill()
    recorder.process.wait(LIMIT_S)
    with _records(file) as before, AnyReader([file]) as reader:
        assert reader.message_count == len(before) > 1000
        topics: dict[str, list[int]] = {}
        for channel, message, _ in before:
            topics.setdefault(channel.topic, []).append(message.sequence)
            assert message.publish_time <= message.log_time
        assert killed_ns - max(message.publish_time for _, message, _ in before) < 1_000_000_000
    assert len(topics) == 6
    for sequences in topics.values():
        assert sequences == list(range(sequences[0], sequences[0] + len(sequences)))
    with pytest.raises(RecordingError, match="never closed"):
        load_recording(tmp_path / "out")
    outcome = repair(tmp_path / "out")
    assert outcome.lost_bytes == 0
    recording = load_recording(tmp_path / "out")
    assert {f"/hand/{name}": len(data) for name, data in recording.topics.items()} == {
        name: len(sequences) for name, sequences in topics.items()
    }


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_everything_published_is_recorded(start: Start, tmp_path: Path, storage: str) -> None:
    """Breaks when messages are dropped at 8 topics of 200 Hz, or SIGINT does not close the recording."""
    recorder = _recorder(start, out="out", storage=storage, namespaces="[/hand,left_hand]")
    talker = _talker(start, 200, 8)
    talker.wait_for("ready")
    began = time.monotonic()
    until(lambda: time.monotonic() - began > 2.0, LIMIT_S)
    code, out, _ = talker.end()
    sent = json.loads(out)
    assert code == 0
    began = time.monotonic()
    until(lambda: time.monotonic() - began > 0.3, LIMIT_S)
    code, _, err = recorder.end()
    assert code == 0, err
    with AnyReader([tmp_path / "out"]) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        # The publishers may know the recorder a moment before it knows them: the very first may miss, no later one.
        assert all(0 <= sent[name] - counts[name] < 40 for name in sent), (sent, counts)
        assert counts["/diagnostics"] == 0
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)
    recording = load_recording(tmp_path / "out", "/hand")
    assert (np.diff(recording["adc"]["sequence"].astype(np.int64)) == 1).all()
    assert recording["adc"]["sequence"][-1] == sent["/hand/adc"] - 1 > 300
    for topic, field in {"joint_states": "position", "pressures": "pressure", "valve_command": "pressure"}.items():
        assert (np.diff(recording[topic][field][:, 0]) % 100 == 1).all()


def test_type_hashes_and_qos_are_those_on_the_wire(
    start: Start, tmp_path: Path, ros_environment: dict[str, str]
) -> None:
    """Breaks when the recording claims another type version or QoS than the publishers announce."""
    talker = _talker(start, 50, 6)
    recorder = _recorder(start, out="bag.mcap", duration_s="1.5")
    talker.wait_for("ready")
    script = (
        "import json, rclpy, time\n"
        "rclpy.init(); node = rclpy.create_node('asker'); end = time.monotonic() + 20\n"
        "topics = ['/hand/joint_states', '/hand/adc', '/hand/controller_state', '/diagnostics']\n"
        "find = lambda: [(node.get_publishers_info_by_topic(t) + [None])[0] for t in topics]\n"
        "while not all(find()) and time.monotonic() < end: time.sleep(0.05)\n"
        "print(json.dumps({t: [str(i.topic_type_hash), i.qos_profile.reliability.name.lower()]"
        " for t, i in zip(topics, find())}))\n"
    )
    asked = subprocess.run(
        [sys.executable, "-c", script],
        check=True,
        env=ros_environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
    )
    code = recorder.process.wait(LIMIT_S)
    assert code == 0
    with (tmp_path / "bag.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    recorded = {channel.topic: channel.metadata for channel in summary.channels.values()}
    for topic, (type_hash, reliability) in json.loads(asked.stdout).items():
        assert recorded[topic]["topic_type_hash"] == type_hash
        assert f"reliability: {reliability}" in recorded[topic]["offered_qos_profiles"]


def test_the_command_records_and_reports(start: Start, tmp_path: Path) -> None:
    """Breaks when `hand record` reports other numbers than it wrote, or SIGTERM is not a clean end."""
    talker = _talker(start, 100, 2)
    code = "import typer; from hand_tool.record import record; a = typer.Typer(); a.command()(record); a()"
    arguments = ["--out", "bag", "--topics", "/hand/pressures", "--topics", "hand/joint_states", "--json"]
    recorder = start([sys.executable, "-c", code, *arguments])
    file = tmp_path / "bag" / "bag_0.mcap"
    until(lambda: file.exists() and file.stat().st_size > 5_000, LIMIT_S)
    exit_code, out, err = recorder.end(signal.SIGTERM)
    assert exit_code == 0, err
    report = json.loads(out)
    assert {topic["name"] for topic in report["topics"]} == {"/hand/joint_states", "/hand/pressures"}
    with AnyReader([tmp_path / "bag"]) as reader:
        assert {c.topic: c.msgcount for c in reader.connections} == {t["name"]: t["messages"] for t in report["topics"]}
    assert all(90 < topic["rate_hz"] < 110 and topic["missed"] == 0 for topic in report["topics"])
    assert talker.process.poll() is None


def test_nothing_published_is_exit_1_and_bad_parameters_exit_2(start: Start, tmp_path: Path) -> None:
    """Breaks when an empty or impossible recording looks like success, or ends in a traceback."""
    code = "import typer; from hand_tool.record import record; a = typer.Typer(); a.command()(record); a()"
    nothing = start([sys.executable, "-c", code, "--out", "a", "--namespace", "/nobody", "--duration", "0.5"])
    (tmp_path / "there").mkdir()
    exists = start([sys.executable, "-c", code, "--out", "there"])
    storage = _recorder(start, out="b", storage="csv")
    duration = _recorder(start, out="c", duration_s="long")
    assert nothing.process.wait(LIMIT_S) == 1
    assert exists.process.wait(LIMIT_S) == 2
    assert storage.process.wait(LIMIT_S) == 2
    assert "nothing was published" in nothing.end()[2]
    assert exists.end()[2].strip() == "hand record: there exists already; recordings are never overwritten"
    assert storage.end()[2].strip() == "recorder: parameter storage is 'csv'; it must be one of mcap, sqlite3"
    assert duration.process.wait(LIMIT_S) == 2
    assert "parameter duration_s is 'long'; it must be a number" in duration.end()[2]


def test_late_best_effort_publisher_is_still_heard(start: Start, tmp_path: Path) -> None:
    """Breaks when a topic is lost because a publisher with weaker QoS joins after the first one."""
    recorder = _recorder(start, out="bag.mcap")
    script = (
        "import sys, time, rclpy\n"
        "from rclpy.qos import QoSProfile, ReliabilityPolicy as R\n"
        "from sensor_msgs.msg import JointState\n"
        "rclpy.init(); node = rclpy.create_node('p_' + sys.argv[1])\n"
        "qos = QoSProfile(depth=9, reliability=R[sys.argv[1]])\n"
        "out = node.create_publisher(JointState, '/hand/joint_states', qos)\n"
        "while out.get_subscription_count() < 1: time.sleep(0.01)\n"
        "print('ready', flush=True)\n"
        "message = JointState(name=[sys.argv[1]], position=[0.0])\n"
        "try:\n"
        "    while True: out.publish(message); time.sleep(0.02)\n"
        "except KeyboardInterrupt: pass\n"
    )
    reliable = start([sys.executable, "-c", script, "RELIABLE"])
    reliable.wait_for("ready")
    weaker = start([sys.executable, "-c", script, "BEST_EFFORT"])
    weaker.wait_for("ready")
    began = time.monotonic()
    until(lambda: time.monotonic() - began > 1.0, LIMIT_S)
    assert recorder.end()[0] == 0
    names = set(load_recording(tmp_path / "bag.mcap")["joint_states"].names)
    assert names == {"RELIABLE", "BEST_EFFORT"}


@pytest.mark.long
def test_the_memory_of_a_recorder_does_not_grow_with_its_recording(start: Start, tmp_path: Path) -> None:
    """Fails when the recorder keeps a part of what it has written: 8,000 messages a second for eight seconds."""

    def resident_mb() -> float:
        status = Path(f"/proc/{recorder.process.pid}/status").read_text(encoding="utf-8")
        return int(status.partition("VmRSS:")[2].split()[0]) / 1024.0

    def written_mb() -> float:
        return sum(path.stat().st_size for path in (tmp_path / "out").iterdir()) / 1024.0**2

    recorder = _recorder(start, out="out", namespaces="[/hand,left_hand]")
    talker = _talker(start, 1000, 8)
    talker.wait_for("ready")
    time.sleep(2.0)  # buffers fill
    memory_mb, file_mb = resident_mb(), written_mb()
    time.sleep(8.0)
    grown_mb = resident_mb() - memory_mb
    recorded_mb = written_mb() - file_mb
    print(f"{recorded_mb:.1f} MB written, compressed; the memory grew by {grown_mb:.1f} MB")
    assert recorded_mb > 2.0
    assert grown_mb < 3.0  # 15 MB and more of messages arrive meanwhile
    assert talker.end()[0] == recorder.end()[0] == 0


def test_a_namespace_that_no_node_can_have_is_one_line(tmp_path: Path) -> None:
    """Fails when `hand record` ends in a traceback for a namespace with a space."""
    command = [sys.executable, "-m", "hand_tool", "record", "--namespace", "a b", "--out", str(tmp_path / "a.mcap")]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "'a b'" in done.stderr
