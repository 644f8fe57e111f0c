"""The SQLite3 storage, read back with rosbags."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from rosbags.highlevel import AnyReader

from hand_recording.bag_writer import Topic, open_bag
from hand_recording.repair import repair

CLOCK = "rosgraph_msgs/msg/Clock"
RAW = b"\x00\x01\x00\x00" + bytes(8)


def test_closed_recording_opens_with_metadata(make_bag: Callable[..., Path]) -> None:
    """Breaks when the folder is not a rosbag2 recording of version 9."""
    folder = make_bag("bag", "sqlite3")
    with AnyReader([folder]) as reader:
        assert reader.message_count == 700
        for connection, _, raw in reader.messages():
            assert connection.digest == reader.typestore.hash_rihs01(connection.msgtype)
            reader.deserialize(raw, connection.msgtype)


def test_messages_are_committed_within_half_a_second(tmp_path: Path) -> None:
    """Breaks when a killed recorder loses more than a second; and when repairing does not make the folder readable."""
    bag = open_bag(tmp_path / "bag", "sqlite3")
    bag.add_topic(Topic.of("/clock", CLOCK))
    bag.tick(0)
    bag.write("/clock", RAW, 1, 1)
    bag.tick(500_000_000)
    bag.write("/clock", RAW, 2, 2)
    killed = tmp_path / "killed"
    shutil.copytree(tmp_path / "bag", killed)
    bag.close()
    outcome = repair(killed)
    assert (outcome.messages, outcome.changed) == ({"/clock": 1}, True)
    with AnyReader([killed]) as reader:
        assert [time for _, time, _ in reader.messages()] == [1]
    assert not repair(killed).changed
    with closing(sqlite3.connect(killed / "bag_0.db3")) as database:
        assert database.execute("PRAGMA integrity_check").fetchone() == ("ok",)
