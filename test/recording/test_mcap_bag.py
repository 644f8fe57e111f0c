"""The MCAP writer, read back with other people's readers."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

from hand_recording.bag_writer import BagError, BagWriter, Topic, open_bag
from hand_recording.mcap_bag import CHUNK_BYTES

MakeBag = Callable[..., Path]
FOREVER = QosTime(9223372036, 854775807)
QOS = Qos(
    QosHistory.KEEP_LAST,
    10,
    QosReliability.RELIABLE,
    QosDurability.TRANSIENT_LOCAL,
    FOREVER,
    FOREVER,
    QosLiveliness.AUTOMATIC,
    FOREVER,
    False,
)
CLOCK = "rosgraph_msgs/msg/Clock"
RAW = b"\x00\x01\x00\x00" + bytes(8)


def _on_disk(bag: BagWriter, path: Path, copy: Path) -> int:
    """Messages that two other readers find in the file as it is now, with nothing flushed or closed."""
    shutil.copy(path, copy)
    with AnyReader([copy]) as reader:
        theirs = [reader.deserialize(raw, connection.msgtype) for connection, _, raw in reader.messages()]
    with copy.open("rb") as stream:
        assert len(list(make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages())) == len(
            theirs
        )
    return len(theirs)


def test_open_file_is_whole_and_at_most_half_a_second_behind(tmp_path: Path) -> None:
    """Breaks when a killed recorder's file does not open elsewhere, or more than a second is missing in it."""
    path, copy = tmp_path / "a.mcap", tmp_path / "copy.mcap"
    bag = open_bag(path)
    bag.add_topic(Topic.of("/clock", CLOCK))
    bag.tick(0)
    bag.write("/clock", RAW, 10, 5)
    bag.tick(499_999_999)
    assert path.stat().st_size < 200
    bag.tick(500_000_000)
    assert _on_disk(bag, path, copy) == 1
    bag.write("/clock", RAW, 20, 15)
    bag.tick(700_000_000)
    assert _on_disk(bag, path, copy) == 1
    bag.tick(1_200_000_000)
    assert _on_disk(bag, path, copy) == 2
    bag.close()
    assert _on_disk(bag, path, copy) == 2


def test_chunks_close_by_size(tmp_path: Path) -> None:
    """Breaks when a fast stream is held back until its chunk has aged."""
    path, copy = tmp_path / "a.mcap", tmp_path / "copy.mcap"
    bag = open_bag(path)
    bag.add_topic(Topic.of("/clock", CLOCK))
    for index in range(CHUNK_BYTES // len(RAW) + 1):
        bag.write("/clock", RAW, index, index)
    assert _on_disk(bag, path, copy) == CHUNK_BYTES // len(RAW) + 1
    bag.close()


def test_closed_folder_opens_with_index_and_metadata(make_bag: MakeBag) -> None:
    """Breaks when folder, bare file, metadata.yaml and summary disagree with each other or with rosbag2's names."""
    folder = make_bag("grasp", ticks=300)
    file = folder / "grasp_0.mcap"
    for path in (folder, file):
        with AnyReader([path]) as reader:
            assert reader.message_count == 7 * 300
            for connection, _, raw in reader.messages():
                reader.deserialize(raw, connection.msgtype)
    with file.open("rb") as stream:
        reader2 = make_reader(stream, validate_crcs=True)
        assert reader2.get_header().profile == "ros2"
        summary = reader2.get_summary()
        assert summary is not None
        assert all(schema.encoding == "ros2msg" for schema in summary.schemas.values())
        assert max(index.uncompressed_size for index in summary.chunk_indexes) < 2 * CHUNK_BYTES
        assert [record.name for record in reader2.iter_metadata()] == ["rosbag2"]
    content = yaml.safe_load((folder / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert content["version"] == 9
    assert content["relative_file_paths"] == ["grasp_0.mcap"]
    assert content["message_count"] == 7 * 300 == sum(t["message_count"] for t in content["topics_with_message_count"])
    assert content["duration"]["nanoseconds"] == 299 * 5_000_000


def test_qos_and_type_hash_are_kept(tmp_path: Path) -> None:
    """Breaks when a player could not offer what the publisher offered, or a type's version is lost."""
    bag = open_bag(tmp_path / "bag")
    topic = Topic.of("/clock", CLOCK, [QOS])
    bag.add_topic(topic)
    bag.write("/clock", RAW, 1, 1)
    bag.close()
    with AnyReader([tmp_path / "bag"]) as reader:
        (connection,) = reader.connections
        assert connection.digest == topic.type_hash == reader.typestore.hash_rihs01(CLOCK)
        assert getattr(connection.ext, "offered_qos_profiles", None) == [QOS]
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as stream:
        _, channel, message = next(make_reader(stream).iter_messages())
    assert channel.metadata["topic_type_hash"] == topic.type_hash
    assert yaml.safe_load(channel.metadata["offered_qos_profiles"])[0]["durability"] == "transient_local"
    assert (message.log_time, message.publish_time) == (1, 1)


def test_recording_without_messages_still_opens(tmp_path: Path) -> None:
    """Breaks when nothing was published and the recording is then unreadable."""
    bag = open_bag(tmp_path / "bag")
    bag.add_topic(Topic.of("/clock", CLOCK))
    bag.close()
    bag.close()
    with AnyReader([tmp_path / "bag"]) as reader:
        assert reader.message_count == 0
        assert [connection.topic for connection in reader.connections] == ["/clock"]


@pytest.mark.parametrize(
    ("name", "storage", "reason"),
    [
        ("there", "mcap", "exists already"),
        ("there.mcap", "mcap", "exists already"),
        ("new", "csv", "allowed: mcap, sqlite3"),
        ("new.mcap", "sqlite3", "a folder"),
        ("file/new", "mcap", "cannot be written"),
        ("file/new", "sqlite3", "cannot be written"),
    ],
)
def test_unwritable_recordings_are_refused(tmp_path: Path, name: str, storage: str, reason: str) -> None:
    """Breaks when a recording is overwritten or a bad name ends in a traceback."""
    (tmp_path / "there").mkdir()
    (tmp_path / "there.mcap").touch()
    (tmp_path / "file").touch()
    with pytest.raises(BagError, match=reason):
        open_bag(tmp_path / name, storage)
