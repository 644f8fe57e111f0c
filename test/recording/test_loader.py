"""The loader against ordinary decoding, and on files that are not recordings."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from hand_messages import layouts
from hand_messages.cdr import NS, Layout
from hand_recording.bag_writer import Topic, open_bag
from hand_recording.loader import HAND_TOPICS, Recording, RecordingError, iter_raw, load_recording

MakeBag = Callable[..., Path]
JOINT_STATE = "sensor_msgs/msg/JointState"


def _time_ns(time: Any) -> int:
    return int(time.sec) * NS + int(time.nanosec)


def _check(recording: Recording, path: Path) -> int:
    """Compare every number with rosbags' decoding, bit for bit; returns the messages compared."""
    rows: dict[str, int] = {}
    with AnyReader([path]) as reader:
        for connection, log_ns, raw in reader.messages():
            suffix = connection.topic.rpartition("/")[2]
            data, row = recording[suffix], rows.get(suffix, 0)
            rows[suffix] = row + 1
            message: Any = reader.deserialize(raw, connection.msgtype)
            assert data.log_ns[row] == log_ns
            assert data.stamp_ns[row] == _time_ns(message.header.stamp)
            names = [str(name) for name in getattr(message, "name", getattr(message, "channel", ()))]
            assert list(data.names) == names
            for field, values in data.fields.items():
                if field == "lifetime_ns":
                    assert values[row] == _time_ns(message.lifetime)
                    continue
                expected = np.asarray(getattr(message, field))
                if values.ndim == 2 and not expected.size:
                    assert np.isnan(values[row]).all()
                else:
                    assert values[row].tobytes() == expected.astype(values.dtype).tobytes(), (suffix, field)
    assert rows == {suffix: len(data) for suffix, data in recording.topics.items()}
    return sum(rows.values())


@pytest.mark.parametrize(("name", "storage"), [("bag", "mcap"), ("bag.mcap", "mcap"), ("bag", "sqlite3")])
def test_arrays_equal_ordinary_decoding(make_bag: MakeBag, name: str, storage: str) -> None:
    """Breaks when any number of any topic differs from what rosbags decodes, in either storage."""
    path = make_bag(name, storage, ticks=400)
    recording = load_recording(path)
    assert _check(recording, path) == 400 * len(HAND_TOPICS)
    states = recording["joint_states"]
    sent_ns = 1_000_000 if storage == "mcap" else 2_000_000
    assert (states.publish_ns - states.stamp_ns == sent_ns).all()
    assert recording["adc"].names == tuple(map(str, range(7)))
    assert recording["valve_command"]["lifetime_ns"].shape == (400,)


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunked", [True, False])
def test_other_writers_files_load_alike(
    tmp_path: Path, make_bag: MakeBag, compression: CompressionType, chunked: bool
) -> None:
    """Breaks when a file without index, without chunks, or with another compression gives other arrays."""
    ours, theirs = make_bag("ours.mcap"), tmp_path / "theirs.mcap"
    with theirs.open("wb") as stream:
        index = IndexType.ALL if compression != CompressionType.NONE else IndexType.NONE
        writer = Writer(stream, 10_000, compression, index, use_chunking=chunked)
        writer.start("ros2")
        channels: dict[str, int] = {}
        for message in iter_raw(ours):
            if message.topic.name not in channels:
                schema = writer.register_schema(message.topic.type, "ros2msg", message.topic.definition.encode())
                channels[message.topic.name] = writer.register_channel(message.topic.name, "cdr", schema)
            writer.add_message(channels[message.topic.name], message.log_ns, message.raw, message.publish_ns)
        writer.finish()
    assert _check(load_recording(theirs), theirs) == 700
    for name, data in load_recording(ours).topics.items():
        same = load_recording(theirs)[name]
        assert (same.publish_ns == data.publish_ns).all()


def _write(path: Path, raws: list[bytes], topic: str = "/hand/joint_commands") -> Path:
    bag = open_bag(path)
    bag.add_topic(Topic.of(topic, JOINT_STATE))
    for index, raw in enumerate(raws):
        bag.write(topic, raw, index, index)
    bag.close()
    return path


def _command(names: list[str], position: list[float], effort: list[float]) -> bytes:
    lengths = {"position": len(position), "velocity": 0, "effort": len(effort)}
    layout = Layout(layouts.JOINT_STATE, "", names, lengths)
    lists = {"position": position, "effort": effort}
    return layout.encode(1, **{key: value for key, value in lists.items() if value})


def _big_endian(names: list[str], position: list[float]) -> bytes:
    store = get_typestore(Stores.ROS2_JAZZY)
    kinds = store.types
    header = kinds["std_msgs/msg/Header"](stamp=kinds["builtin_interfaces/msg/Time"](sec=0, nanosec=1), frame_id="")
    none = np.empty(0)
    message = kinds[JOINT_STATE](header=header, name=names, position=np.array(position), velocity=none, effort=none)
    return bytes(store.serialize_cdr(message, JOINT_STATE, little_endian=False))


def test_partial_lists_are_laid_out_by_name(tmp_path: Path) -> None:
    """Breaks when varying names, empty lists, more layouts than are remembered, or byte order mix columns up."""
    raws = [
        _command(["a", "b"], [1.0, 2.0], []),
        _command(["b", "a"], [3.0, 4.0], [5.0, 6.0]),
        _big_endian(["c"], [7.0]),
        *(_command(["b"], [float(i)], []) for i in range(3)),
        *(_command([f"x{i}"], [1.0], []) for i in range(6)),
    ]
    data = load_recording(_write(tmp_path / "a.mcap", raws))["joint_commands"]
    assert sorted(data.names) == ["a", "b", "c", "x0", "x1", "x2", "x3", "x4", "x5"]
    assert data.log_ns.tolist() == list(range(len(raws)))
    column = {name: data["position"][:, data.names.index(name)] for name in data.names}
    nan = np.nan
    np.testing.assert_array_equal(column["a"][:6], [1, 4, nan, nan, nan, nan])
    np.testing.assert_array_equal(column["b"][:6], [2, 3, nan, 0, 1, 2])
    np.testing.assert_array_equal(column["c"][:6], [nan, nan, 7, nan, nan, nan])
    assert [column[f"x{i}"][6 + i] for i in range(6)] == [1.0] * 6
    np.testing.assert_array_equal(data["effort"][1, [data.names.index("b"), data.names.index("a")]], [5, 6])
    assert data.malformed == 0


def test_bad_messages_are_left_out_and_counted(tmp_path: Path) -> None:
    """Breaks when one bad message makes a recording unreadable, or gets into the arrays."""
    good = _command(["a", "b"], [1.0, 2.0], [])
    bad = [_command(["a", "b"], [1.0], []), _command(["a", "a"], [1.0, 2.0], []), good[:-9], b"", b"noise"]
    data = load_recording(_write(tmp_path / "a.mcap", [good, *bad, good]))["joint_commands"]
    assert (len(data), data.malformed) == (2, 5)
    assert data.log_ns.tolist() == [0, 6]
    with pytest.raises(RecordingError, match="none of its 5 messages decodes as sensor_msgs/msg/JointState"):
        load_recording(_write(tmp_path / "b.mcap", bad))


def test_messages_are_put_in_order_of_receipt(tmp_path: Path) -> None:
    """Breaks when a file written out of order gives times that run backwards."""
    bag = open_bag(tmp_path / "a.mcap")
    bag.add_topic(Topic.of("/hand/joint_states", JOINT_STATE))
    for log_ns in (5, 3, 4, 3):
        bag.write("/hand/joint_states", _command(["a"], [float(log_ns)], []), log_ns, 0)
    bag.close()
    data = load_recording(tmp_path / "a.mcap")["joint_states"]
    assert data.log_ns.tolist() == data["position"][:, 0].tolist() == [3, 3, 4, 5]


def test_the_hand_is_found_by_its_namespace(tmp_path: Path) -> None:
    """Breaks when two hands are mixed, or the one asked for is not the one loaded."""
    bag = open_bag(tmp_path / "a.mcap")
    for number, space in enumerate(("/left", "/right/hand", "")):
        bag.add_topic(Topic.of(f"{space}/joint_states", JOINT_STATE))
        bag.write(f"{space}/joint_states", _command(["a"], [float(number)], []), 1, 1)
    bag.close()
    for number, space in enumerate(("left", "/right/hand/", "/")):
        data = load_recording(tmp_path / "a.mcap", space)["joint_states"]
        assert data["position"].tolist() == [[float(number)]]
    with pytest.raises(RecordingError, match="several hands: /left, /right/hand, /; name one"):
        load_recording(tmp_path / "a.mcap")
    with pytest.raises(RecordingError, match="no hand /middle; it has: /left"):
        load_recording(tmp_path / "a.mcap", "middle")


def _foreign(path: Path, topic: str, kind: str, text: str = "uint8 a\n") -> Path:
    bag = open_bag(path)
    bag.add_topic(Topic(topic, kind, text, ""))
    bag.write(topic, b"\x00\x01\x00\x00\x00", 1, 1)
    bag.close()
    return path


def test_what_is_no_recording_of_a_hand_is_refused(tmp_path: Path, make_bag: MakeBag) -> None:
    """Breaks when one of these ends in a traceback, in arrays, or in a message that names neither file nor reason."""
    (tmp_path / "text.txt").write_text("x")
    (tmp_path / "text.mcap").write_text("a text long enough to be looked at")
    (tmp_path / "text.db3").write_text("a text long enough to be looked at")
    (tmp_path / "zero.mcap").touch()
    (tmp_path / "folder").mkdir()
    whole = make_bag("whole.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    shutil.copytree(make_bag("dead"), tmp_path / "open", ignore=shutil.ignore_patterns("metadata.yaml"))
    shutil.copytree(tmp_path / "dead", tmp_path / "lacking", ignore=shutil.ignore_patterns("*.mcap"))
    shutil.copytree(tmp_path / "dead", tmp_path / "yaml")
    (tmp_path / "yaml" / "metadata.yaml").write_text("a: [")
    empty = open_bag(tmp_path / "nothing")
    empty.add_topic(Topic.of("/hand/joint_states", JOINT_STATE))
    empty.close()
    _foreign(tmp_path / "other.mcap", "/camera", "a_msgs/msg/B")
    _foreign(tmp_path / "type.mcap", "/hand/pressures", "a_msgs/msg/B")
    _foreign(tmp_path / "version.mcap", "/hand/pressures", "hand_msgs/msg/JointPressures")
    damaged = bytearray(whole)
    damaged[2000:2100] = bytes(100)
    (tmp_path / "damaged.mcap").write_bytes(damaged)
    for name, reason in {
        "gone": "does not exist",
        "text.txt": "neither a folder nor",
        "text.mcap": "not a .mcap file",
        "text.db3": "not a .db3 file",
        "zero.mcap": "is empty",
        "folder": "not a recording: it contains no metadata.yaml",
        "cut.mcap": "cut off.* --repair",
        "open": "never closed.* --repair",
        "lacking": "lacks its file dead_0.mcap",
        "yaml": "not rosbag2 metadata",
        "nothing": "no message of the hand /hand",
        "other.mcap": "none of joint_states, .*; it has: /camera",
        "type.mcap": "/hand/pressures is a_msgs/msg/B, not hand_msgs/msg/JointPressures",
        "version.mcap": "another version of hand_msgs/msg/JointPressures",
        "damaged.mcap": "damaged.* --repair",
    }.items():
        with pytest.raises(RecordingError, match=reason) as caught:
            load_recording(tmp_path / name)
        assert name in str(caught.value)
        assert "\n" not in str(caught.value)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("whole") / "a.mcap"
    return _write(path, [_command(["a", "b"], [float(i), 0.5], []) for i in range(50)]).read_bytes()


@given(st.lists(st.tuples(st.floats(0, 1), st.integers(1, 255)), min_size=1, max_size=3), st.floats(0.5, 1))
def test_mutated_files_never_end_in_a_traceback(whole: bytes, flips: list[tuple[float, int]], keep: float) -> None:
    """Breaks when bytes that are not what they should be raise anything but RecordingError."""
    content = bytearray(whole)
    for where, flip in flips:
        content[round(where * (len(content) - 1))] ^= flip
    if keep < 0.6:
        del content[round(keep * len(content)) : -8]
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.mcap"
        path.write_bytes(content)
        try:
            assert len(load_recording(path)["joint_commands"]) <= 50
        except RecordingError as error:
            assert "\n" not in str(error)
        try:
            assert len(list(iter_raw(path))) <= 50
        except RecordingError as error:
            assert "\n" not in str(error)
