"""A recording that becomes long, and one whose disk becomes full."""

from __future__ import annotations

import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.reader import make_reader

from hand_recording.bag_writer import Topic, open_bag
from hand_recording.chunk_index import ChunkIndexOnDisk
from hand_recording.mcap_chunks import is_indexed
from hand_recording.reading import iter_raw
from hand_recording.recording_files import RecordingError
from hand_recording.repair import repair

CLOCK = "rosgraph_msgs/msg/Clock"
RAW = b"\x00\x01\x00\x00" + bytes(8)
HALF_SECOND_NS = 500_000_000
GROWTH_KB = 2000
MESSAGES = 15_400


def resident_kb() -> int:
    """Memory of this process that is resident [kB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1])
    return pages * resource.getpagesize() // 1024


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_memory_does_not_grow_with_the_recording(storage: str, tmp_path: Path) -> None:
    """Fails when anything is kept for every message or chunk: two hours of chunks, which took 10 MB, take none."""
    bag = open_bag(tmp_path / "bag", storage)
    bag.add_topic(Topic.of("/clock", CLOCK))
    before = 0
    step_ns = HALF_SECOND_NS if storage == "mcap" else HALF_SECOND_NS // 400  # a commit waits for the disk
    for k in range(MESSAGES):
        if k == 1000:
            before = resident_kb()
        bag.write("/clock", RAW, k * step_ns, k * step_ns)
        bag.tick((k + 1) * step_ns)
    grown = resident_kb() - before
    bag.close()
    assert grown < GROWTH_KB
    assert sum(1 for _ in iter_raw(tmp_path / "bag")) == MESSAGES


def test_the_index_from_the_file_is_the_one_of_the_library(make_bag: Callable[..., Path]) -> None:
    """Fails when a chunk, a time, a size or an offset of the index differs from what the chunks say."""
    path = make_bag("bag", ticks=400) / "bag_0.mcap"
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None and is_indexed(summary) and len(summary.chunk_indexes) > 3
    assert list(ChunkIndexOnDisk(path)) == sorted(summary.chunk_indexes, key=lambda index: index.chunk_start_offset)
    assert summary.statistics is not None
    assert summary.statistics.chunk_count == len(summary.chunk_indexes)
    assert not repair(path).changed


FULL = """
import random, resource, sys
from contextlib import suppress
from pathlib import Path
from hand_recording.bag_writer import Topic, open_bag

bag = open_bag(Path(sys.argv[1]), sys.argv[2])
bag.add_topic(Topic.of("/clock", "rosgraph_msgs/msg/Clock"))
limit = int(sys.argv[3])
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
noise = random.Random(1)
try:
    for k in range(100_000):
        bag.tick(k * 5_000_000)
        bag.write("/clock", bytes([0, 1, 0, 0]) + noise.randbytes(8), k * 5_000_000, k * 5_000_000)
except OSError as error:
    with suppress(OSError):
        bag.close()
    print("full:", error.strerror)
"""


@pytest.mark.parametrize("limit", [150_000, 200_001, 262_144])
@pytest.mark.parametrize(("name", "storage"), [("bag", "mcap"), ("bag.mcap", "mcap"), ("bag", "sqlite3")])
def test_a_full_disk_leaves_what_was_recorded(name: str, storage: str, limit: int, tmp_path: Path) -> None:
    """Fails when a write that was cut off leaves a file that neither opens nor can be repaired, or another error."""
    path = tmp_path / name
    done = subprocess.run(
        [sys.executable, "-c", FULL, str(path), storage, str(limit)], capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith("full:"), done.stdout + done.stderr
    if path.is_dir():
        with pytest.raises(RecordingError, match="repair it with: hand record --repair"):
            next(iter_raw(path))
    else:
        readable = sum(1 for _ in iter_raw(path))
        assert readable > 100
    outcome = repair(path)
    assert outcome.changed and outcome.lost_bytes == 0
    kept = sum(1 for _ in iter_raw(path))
    assert kept == sum(outcome.messages.values()) > 100
    assert not repair(path).changed
