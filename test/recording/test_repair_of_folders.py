"""Repair of recordings as rosbag2 leaves them: split, compressed, cut off, still being written."""

from __future__ import annotations

import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from zstandard import ZstdCompressor

from hand_recording.bag_contents import BagError
from hand_recording.file_use import user_of
from hand_recording.loader import load_recording
from hand_recording.reading import iter_raw
from hand_recording.recording_files import RecordingError
from hand_recording.repair import repair

MakeBag = Callable[..., Path]
TICKS, TOPICS = 100, 7


def compressed(source: Path, out: Path, mode: CompressionMode) -> Path:
    """A copy of a recording as rosbag2 writes it with compression."""
    writer = Writer(out, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer, AnyReader([source]) as reader:
        connections = {
            c.id: writer.add_connection(c.topic, c.msgtype, typestore=reader.typestore) for c in reader.connections
        }
        for connection, time_ns, raw in reader.messages():
            writer.write(connections[connection.id], time_ns, raw)
    return out


def split(make_bag: MakeBag, folder: Path, parts: int, storage: str = "mcap") -> Path:
    """A folder of several files as a split recording has them, without metadata.yaml."""
    folder.mkdir()
    ending = "mcap" if storage == "mcap" else "db3"
    for number in range(parts):
        made = make_bag(f"{folder.name}_part{number}", storage)
        shutil.copy(made / f"{made.name}_0.{ending}", folder / f"{folder.name}_{number}.{ending}")
    return folder


def pack(file: Path) -> None:
    file.with_name(file.name + ".zstd").write_bytes(ZstdCompressor().compress(file.read_bytes()))
    file.unlink()


def listed(folder: Path) -> list[str]:
    content = yaml.safe_load((folder / "metadata.yaml").read_text(encoding="utf-8"))
    return list(content["rosbag2_bagfile_information"]["relative_file_paths"])


def messages(path: Path) -> int:
    return sum(1 for _ in iter_raw(path))


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_killed_split_recording_is_completed(storage: str, tmp_path: Path, make_bag: MakeBag) -> None:
    """Fails when one part alone is listed, an empty last part is an error, or a complete folder is called broken."""
    folder = split(make_bag, tmp_path / "bag", 11, storage)
    ending = "mcap" if storage == "mcap" else "db3"
    (folder / f"bag_11.{ending}").touch()
    outcome = repair(folder)
    assert outcome.changed and sum(outcome.messages.values()) == 11 * TOPICS * TICKS
    assert listed(folder) == [f"bag_{k}.{ending}" for k in range(11)]
    assert messages(folder) == 11 * TOPICS * TICKS
    before = {path: path.read_bytes() for path in folder.iterdir()}
    again = repair(folder)
    assert not again.changed and again.messages == outcome.messages
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_the_last_part_is_cut_off(tmp_path: Path, make_bag: MakeBag) -> None:
    """Fails when a damaged part of a split recording loses its undamaged messages, or the original is not kept."""
    folder = split(make_bag, tmp_path / "bag", 3)
    last = folder / "bag_2.mcap"
    content = last.read_bytes()
    last.write_bytes(content[: len(content) * 2 // 3])
    outcome = repair(folder)
    assert outcome.damaged == folder / "bag_2.mcap.damaged" and outcome.lost_bytes > 0
    assert outcome.damaged.read_bytes() == content[: len(content) * 2 // 3]
    assert 2 * TOPICS * TICKS < messages(folder) == sum(outcome.messages.values()) < 3 * TOPICS * TICKS


def test_a_killed_split_and_compressed_recording_is_completed(tmp_path: Path, make_bag: MakeBag) -> None:
    """Fails when a compressed part is left out, or the part that was being compressed is lost or counted twice."""
    folder = split(make_bag, tmp_path / "bag", 3)
    pack(folder / "bag_0.mcap")
    half = ZstdCompressor().compress((folder / "bag_1.mcap").read_bytes())
    (folder / "bag_1.mcap.zstd").write_bytes(half[: len(half) // 2])
    outcome = repair(folder)
    assert sum(outcome.messages.values()) == 3 * TOPICS * TICKS
    assert listed(folder) == [f"bag_{k}.mcap.zstd" for k in range(3)]
    assert messages(folder) == 3 * TOPICS * TICKS
    assert (folder / "bag_1.mcap.zstd.damaged").is_file()
    assert not repair(folder).changed


def test_a_compressed_part_that_is_cut_off_keeps_its_beginning(tmp_path: Path, make_bag: MakeBag) -> None:
    """Fails when a cut compressed file is lost as a whole, or replaced without a copy."""
    folder = split(make_bag, tmp_path / "bag", 2)
    shutil.copy(make_bag("long", ticks=1000) / "long_0.mcap", folder / "bag_1.mcap")  # several blocks of the compressor
    for number in range(2):
        pack(folder / f"bag_{number}.mcap")
    part = folder / "bag_1.mcap.zstd"
    content = part.read_bytes()
    part.write_bytes(content[: len(content) - 500])
    outcome = repair(folder)
    assert outcome.lost_bytes > 0 and outcome.damaged == folder / "bag_1.mcap.zstd.damaged"
    assert TOPICS * TICKS < messages(folder) == sum(outcome.messages.values()) < 11 * TOPICS * TICKS


@pytest.mark.parametrize("mode", [CompressionMode.MESSAGE, CompressionMode.FILE])
def test_a_lost_metadata_file_does_not_lose_the_compression(
    mode: CompressionMode, tmp_path: Path, make_bag: MakeBag
) -> None:
    """Fails when a compressed recording cannot be read after a repair, or its sound file is rewritten."""
    folder = compressed(make_bag(), tmp_path / "packed", mode)
    (folder / "metadata.yaml").unlink()
    files = {path: path.read_bytes() for path in folder.iterdir()}
    assert repair(folder).changed
    assert {path: path.read_bytes() for path in files} == files
    content = yaml.safe_load((folder / "metadata.yaml").read_text(encoding="utf-8"))["rosbag2_bagfile_information"]
    assert (content["compression_format"], content["compression_mode"]) == ("zstd", mode.name)
    assert messages(folder) == TOPICS * TICKS
    assert len(load_recording(folder)["joint_states"]) == TICKS
    assert not repair(folder).changed


def test_compressed_messages_are_read_from_the_bare_file(tmp_path: Path, make_bag: MakeBag) -> None:
    """Fails when message compression is known from metadata.yaml alone: "none of its messages decodes"."""
    folder = compressed(make_bag(), tmp_path / "packed", CompressionMode.MESSAGE)
    (bare,) = folder.glob("*.mcap")
    loaded = load_recording(bare)["joint_states"]
    assert len(loaded) == TICKS and loaded.malformed == 0
    assert messages(bare) == TOPICS * TICKS


def test_metadata_that_states_another_count_is_written_again(make_bag: MakeBag) -> None:
    """Fails when a metadata.yaml that does not agree with its file is called complete."""
    folder = make_bag()
    path = folder / "metadata.yaml"
    path.write_text(path.read_text(encoding="utf-8").replace("message_count: 700", "message_count: 900"))
    assert repair(folder).changed
    assert "message_count: 700" in path.read_text(encoding="utf-8")


HOLD = "import sys, time; stream = open(sys.argv[1], 'ab'); print('open', flush=True); time.sleep(60)"


@pytest.fixture
def held(make_bag: MakeBag) -> Iterator[Path]:
    """A recording that another process has open for writing, without a lock, as rosbag2 has."""
    folder = make_bag()
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(folder / "bag_0.mcap")], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stdout.readline() == "open\n"
    yield folder
    process.kill()
    process.wait()
    process.stdout.close()


def test_a_recording_that_another_program_writes_is_not_touched(held: Path) -> None:
    """Fails when the file of a recorder that takes no lock is replaced under it."""
    before = (held / "bag_0.mcap").read_bytes()
    (held / "metadata.yaml").unlink()
    for path in (held, held / "bag_0.mcap"):
        with pytest.raises(BagError, match=r"bag_0\.mcap is still being recorded or read: process \d+ has it open"):
            repair(path)
    assert (held / "bag_0.mcap").read_bytes() == before and user_of(held / "bag_0.mcap") is not None


def test_a_recording_that_grows_is_not_touched(make_bag: MakeBag) -> None:
    """Fails when a file that grows is repaired because its writer belongs to another user or machine."""
    folder = make_bag()
    file = folder / "bag_0.mcap"

    def grow() -> None:
        with file.open("ab") as stream:
            stream.write(b"more")

    writer = threading.Timer(0.1, grow)
    writer.start()
    with pytest.raises(BagError, match="still being recorded: it changes"):
        repair(folder, watch_s=0.5)
    writer.join()


def test_single_files_of_a_folder_are_refused_with_the_way_out(tmp_path: Path, make_bag: MakeBag) -> None:
    """Fails when a compressed or SQLite file by itself gets a line that does not say what to give instead."""
    folder = split(make_bag, tmp_path / "bag", 1)
    pack(folder / "bag_0.mcap")
    with pytest.raises(RecordingError, match=r"one compressed file of a recording; give its folder, .*bag, or unpack"):
        load_recording(folder / "bag_0.mcap.zstd")
    with pytest.raises(BagError, match=r"one compressed file of a recording; repair its folder: .*bag"):
        repair(folder / "bag_0.mcap.zstd")
    with pytest.raises(RecordingError, match=r"repair it with: hand record --repair"):
        load_recording(folder)
    database = make_bag("sql", "sqlite3") / "sql_0.db3"
    with pytest.raises(BagError, match=r"SQLite repairs the file itself .* repair its folder: .*sql"):
        repair(database)


def test_only_empty_files_are_refused(tmp_path: Path) -> None:
    """Fails when a folder whose recorder was killed before its first chunk becomes a recording without messages."""
    (tmp_path / "a_0.mcap").touch()
    with pytest.raises(BagError, match="holds only empty recording files"):
        repair(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["a_0.mcap"]
