"""Repairing recordings that were cut off or damaged."""

from __future__ import annotations

import random
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from hand_recording.bag_writer import BagError, Topic, open_bag
from hand_recording.repair import repair

MakeBag = Callable[..., Path]
Messages = list[tuple[str, int, int, int, bytes]]


@dataclass(frozen=True)
class Sound:
    """A closed recording of several chunks: its bytes, messages, and (end, messages so far) of each chunk."""

    content: bytes = field(repr=False)
    messages: Messages = field(repr=False)
    chunks: list[tuple[int, int]]


def _messages(path: Path) -> Messages:
    with path.open("rb") as stream:
        return [
            (channel.topic, message.log_time, message.publish_time, message.sequence, message.data)
            for _, channel, message in make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False)
        ]


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Sound:
    path = tmp_path_factory.mktemp("sound") / "a.mcap"
    bag = open_bag(path)
    bag.add_topic(Topic.of("/clock", "rosgraph_msgs/msg/Clock"))
    bag.add_topic(Topic.of("/hand/joint_states", "sensor_msgs/msg/JointState"))
    noise = random.Random(0)
    for index in range(600):
        raw = b"\x00\x01\x00\x00" + noise.randbytes(200 if index % 3 else 8)
        bag.write("/hand/joint_states" if index % 3 else "/clock", raw, index, index, index)
        bag.tick(index * 10_000_000)
    bag.close()
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunks = [
        (chunk.chunk_start_offset + chunk.chunk_length, chunk.message_end_time + 1) for chunk in summary.chunk_indexes
    ]
    assert len(chunks) > 5
    return Sound(path.read_bytes(), _messages(path), chunks)


@contextmanager
def _file(content: bytes) -> Iterator[Path]:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.mcap"
        path.write_bytes(content)
        yield path


@given(st.data())
def test_what_stands_before_the_cut_is_recovered(sound: Sound, data: st.DataObject) -> None:
    """Breaks when a cut at any byte loses a complete chunk, invents a message, or leaves an unreadable file."""
    cut = data.draw(st.integers(8, len(sound.content) - 1))
    with _file(sound.content[:cut]) as path:
        outcome = repair(path)
        repaired = _messages(path)
        assert repaired == sound.messages[: max((count for end, count in sound.chunks if end <= cut), default=0)]
        assert {name: n for name, n in outcome.messages.items() if n} == Counter(topic for topic, *_ in repaired)
        assert outcome.changed
        assert (outcome.damaged is not None) == (outcome.lost_bytes > 0)
        if outcome.damaged:
            assert outcome.damaged.read_bytes() == sound.content[:cut]
        assert not repair(path).changed


@given(st.floats(0, 1), st.integers(1, 255))
def test_after_a_flipped_byte_no_message_is_false(sound: Sound, where: float, flip: int) -> None:
    """Breaks when damage is copied or overlooked, ends in a traceback, or leaves a file that others cannot open."""
    content = bytearray(sound.content)
    content[8 + round(where * (len(content) - 9))] ^= flip
    with _file(bytes(content)) as path:
        outcome = repair(path)
        repaired = _messages(path)
        assert set(repaired) <= set(sound.messages)
        assert outcome.lost_bytes or repaired == sound.messages
        with AnyReader([path]) as reader:
            assert reader.message_count == len(repaired)


def test_a_sound_recording_is_left_alone(make_bag: MakeBag) -> None:
    """Breaks when repairing rewrites what needs none."""
    folder = make_bag()
    before = {path: path.read_bytes() for path in folder.iterdir()}
    outcome = repair(folder)
    assert (outcome.changed, sum(outcome.messages.values())) == (False, 700)
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_missing_metadata_is_written_again(make_bag: MakeBag) -> None:
    """Breaks when a folder that lost its metadata.yaml does not get the same one back."""
    folder = make_bag()
    before = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").unlink()
    assert repair(folder).changed
    assert (folder / "metadata.yaml").read_text() == before


def test_killed_recording_becomes_a_whole_folder(tmp_path: Path, make_bag: MakeBag) -> None:
    """Breaks when a file as a killed recorder leaves it does not become a recording with index and metadata."""
    bag = open_bag(tmp_path / "live")
    bag.add_topic(Topic.of("/clock", "rosgraph_msgs/msg/Clock"))
    bag.write("/clock", b"\x00\x01\x00\x00" + bytes(8), 3, 2, 1)
    bag.tick(10**9)
    killed = tmp_path / "killed"
    shutil.copytree(tmp_path / "live", killed)
    bag.close()
    outcome = repair(killed)
    assert (outcome.messages, outcome.lost_bytes, outcome.changed) == ({"/clock": 1}, 0, True)
    with AnyReader([killed]) as reader:
        assert reader.message_count == 1
    with (killed / "live_0.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
        assert summary is not None
        assert summary.chunk_indexes


def test_a_recording_in_progress_is_not_touched(tmp_path: Path) -> None:
    """Breaks when repairing takes the file away from a recorder that still writes it."""
    bag = open_bag(tmp_path / "bag")
    with pytest.raises(BagError, match="still being recorded"):
        repair(tmp_path / "bag")
    bag.close()
    assert not repair(tmp_path / "bag").changed


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    """Breaks when a foreign path is rewritten or ends in a traceback."""
    (tmp_path / "a.txt").write_text("x")
    (tmp_path / "a.mcap").write_bytes(b"not an MCAP file")
    (tmp_path / "zero.mcap").touch()
    (tmp_path / "empty").mkdir()
    (tmp_path / "sql").mkdir()
    (tmp_path / "sql" / "a.db3").write_bytes(b"not a database, but long enough to be looked at" * 9)
    for name, reason in {
        "a.txt": "not an MCAP file",
        "a.mcap": "MCAP magic",
        "zero.mcap": "MCAP magic",
        "empty": "0 recording files",
        "sql": "not a recording that can be repaired",
        "gone": "does not exist",
    }.items():
        with pytest.raises(BagError, match=reason):
            repair(tmp_path / name)
    assert (tmp_path / "a.mcap").read_bytes() == b"not an MCAP file"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mcap", "a.txt", "empty", "sql", "zero.mcap"]
