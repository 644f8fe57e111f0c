"""The recorder's queues: bounded in bytes, and what is lost is counted and said."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from hand_recording.queue_bound import QUEUE, QUEUE_BYTES, ROUND_BYTES, QueueBound

pytest.importorskip("rclpy", reason="rclpy is not installed")

SIZE, COUNT = 1_000_000, 200
GROWTH_KB = 80_000
"""Queue, the part that a round takes, and the copies of one message; without a bound it is 200 MB."""
STALLED = """
import json, sys, time
from pathlib import Path
import rclpy
from std_msgs.msg import ByteMultiArray, String
from rclpy.node import Node
from hand_recording.node import _Recorder
from hand_recording.record_options import RecordOptions
from hand_ros.memory import return_large_blocks

return_large_blocks()
out, size, count = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
rclpy.init()
talker, node = Node("talker"), Node("recorder")
publisher = talker.create_publisher(String, "/hand/large", 10)
small = talker.create_publisher(String, "/hand/small", 10)
recorder = _Recorder(node, RecordOptions(out))
raw = b"\\0\\1\\0\\0" + (size - 7).to_bytes(4, "little") + b"x" * (size - 8) + b"\\0"
def peak():
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmHWM")).split()[1])
def collect():
    recorder.collect(time.time_ns(), time.monotonic_ns())
end = time.monotonic() + 20.0
while not (publisher.get_subscription_count() and small.get_subscription_count()) and time.monotonic() < end:
    recorder.discover()
    time.sleep(0.05)
publisher.publish(raw)  # its size is known from now on
end = time.monotonic() + 20.0
while not recorder.summary(1.0).messages and time.monotonic() < end:
    collect()
    time.sleep(0.02)
while publisher.get_subscription_count() != 1 and time.monotonic() < end:
    time.sleep(0.02)
time.sleep(0.2)
before = peak()
for k in range(count):  # and nobody collects
    publisher.publish(raw)
    small.publish(String(data=str(k)))
time.sleep(0.5)
collect()
publisher.publish(raw)
time.sleep(0.2)
summary = recorder.finish(1.0).as_json()
print(json.dumps({"grown": peak() - before, **summary}))
"""


def test_the_queue_of_a_topic_has_a_bound_in_bytes() -> None:
    """Fails when messages of any size may wait in any number, or a topic of usual size has a shorter queue."""
    bound = QueueBound()
    assert not bound.shortened("/usual", 1000) and bound.depth("/usual") == QUEUE
    for size in (10_000, 100_000, 100_001, 5_000_000, 100_000_000):
        before = bound.depth("/large")
        shorter = bound.shortened("/large", size)
        assert bound.depth("/large") * size <= max(QUEUE_BYTES, size)
        assert shorter == (bound.depth("/large") < before)
    assert bound.depth("/large") == 1
    assert not bound.shortened("/large", 200_000_000)
    assert set(bound.lines()) == {"/large"}
    assert "up to 200 MB: at most 1 of them" in bound.lines()["/large"]
    assert QUEUE_BYTES < ROUND_BYTES  # so that one round empties a queue


def test_large_messages_that_nobody_takes_are_dropped_and_counted(
    ros_environment: dict[str, str], tmp_path: Path
) -> None:
    """Fails when a stalled recorder keeps every large message, or what it lost is neither counted nor said."""
    command = [sys.executable, "-c", STALLED, str(tmp_path / "bag"), str(SIZE), str(COUNT)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=120, env=ros_environment)
    found = json.loads(done.stdout)
    topics = {topic["name"]: topic for topic in found["topics"]}
    print(found, done.stderr)
    assert found["grown"] < GROWTH_KB
    large = topics["/hand/large"]
    assert 3 <= large["messages"] <= 2 + QUEUE_BYTES // SIZE
    assert large["missed"] == COUNT + 2 - large["messages"]
    assert topics["/hand/small"]["missed"] == 0 and topics["/hand/small"]["messages"] == COUNT
    assert list(found["limited"]) == ["/hand/large"]
    assert "are missed" in found["limited"]["/hand/large"] and "/hand/large: its messages" in done.stderr
