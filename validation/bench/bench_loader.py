"""Loading a recording into arrays, compared with libraries that only iterate over its raw messages.

The recording has 10 minutes of 11 joints at 200 Hz in MCAP with six topics, as the recorder writes it. Three results:

- loading into arrays, compared with the faster of two libraries that only iterate over the raw messages;
- the reader that uses the index of the file (mcap_chunks.py), compared with the iterator of mcap with the same decoder.
  The reader of rosbags does not give the publish times of an MCAP file and is no alternative;
- decoding by fixed layouts (hand_messages/cdr.py), compared with rosbags, which decodes message by message.

The index reader and the fixed layouts are kept as long as each takes at most a third of its reference's time.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

from hand_messages import layouts
from hand_messages.cdr import Layout
from hand_recording.bag_writer import Topic, open_bag
from hand_recording.batches import Batch, gather
from hand_recording.columns import TopicDecoder
from hand_recording.loader import HAND_TOPICS, load_recording
from hand_recording.message_types import typestore_of
from hand_recording.reading import mcap_messages, read_batches
from validation.bench.result import figure

FINGERS = ("thumb", "index", "middle", "ring", "little")
JOINTS = (*(f"{finger}_{part}" for finger in FINGERS for part in ("proximal", "distal")), "thumb_opposition")
RATE_HZ = 200
TOPICS = ("joint_states", "pressures", "contact_forces", "adc", "valve_command", "controller_state")
START_NS = 1_700_000_000_000_000_000
KEPT = 1.0 / 3.0


def make_recording(path: Path, seconds: float) -> None:
    """A bare MCAP file of every topic at RATE_HZ with noisy numbers, `seconds` [s] long."""
    bag = open_bag(path)
    table = []
    for suffix in TOPICS:
        spec = HAND_TOPICS[suffix]
        lengths = {"channel": 33, "counts": 33} if spec is layouts.ADC_FRAME else None
        layout = Layout(spec, "hand", () if lengths else JOINTS, lengths)
        bag.add_topic(Topic.of(f"/hand/{suffix}", spec.type))
        table.append((f"/hand/{suffix}", layout))
    rng = np.random.default_rng(1)
    noise = rng.normal(size=4096 * 64)
    for tick in range(round(seconds * RATE_HZ)):
        stamp_ns = START_NS + tick * 1_000_000_000 // RATE_HZ
        for number, (name, layout) in enumerate(table):
            log_ns = stamp_ns + 300_000 + number * 10_000
            bag.write(name, layout.encode(**_values(layout, stamp_ns, tick, noise)), log_ns, log_ns - 50_000, tick)
        bag.tick(stamp_ns)
    bag.close()


def _values(layout: Layout, stamp_ns: int, tick: int, noise: np.ndarray[Any, Any]) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for slot in layout.slots:
        start = (tick * 17 + slot.offset) % (len(noise) - 64)
        sample = noise[start : start + (slot.length or 1)]
        if slot.key == "stamp_ns":
            values[slot.key] = stamp_ns
        elif slot.key == "lifetime_ns":
            values[slot.key] = 100_000_000
        elif slot.code == "d":
            values[slot.key] = float(sample[0]) if slot.length is None else sample
        elif slot.key == "channel":
            values[slot.key] = range(33)
        elif slot.code == "?":
            values[slot.key] = sample > 0
        else:
            values[slot.key] = tick if slot.length is None else (np.abs(sample) * 1000).astype(np.int64)
    return values


def check_equal(path: Path) -> None:
    """Raises AssertionError unless every array equals the ordinary decoding, bit for bit."""
    recording = load_recording(path)
    rows = dict.fromkeys(TOPICS, 0)
    with Reader(path) as reader:
        for connection, log_ns, raw in reader.messages():
            suffix = connection.topic.rpartition("/")[2]
            data, row = recording[suffix], rows[suffix]
            message: Any = typestore_of(connection.msgtype).deserialize_cdr(raw, connection.msgtype)
            rows[suffix] += 1
            assert data.log_ns[row] == log_ns
            assert data.stamp_ns[row] == message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
            for field, values in data.fields.items():
                if field == "lifetime_ns":
                    assert values[row] == message.lifetime.sec * 1_000_000_000 + message.lifetime.nanosec
                else:
                    assert np.asarray(getattr(message, field), values.dtype).tobytes() == values[row].tobytes(), field
    assert all(len(recording[suffix]) == rows[suffix] for suffix in TOPICS)


def _mcap_raw(path: Path) -> int:
    with path.open("rb") as stream:
        return sum(len(message.data) for _, _, message in make_reader(stream).iter_messages())


def _rosbags_raw(path: Path) -> int:
    with Reader(path) as reader:
        return sum(len(raw) for _, _, raw in reader.messages())


def _ours(path: Path) -> int:
    return sum(len(topic) for topic in load_recording(path).topics.values())


def _arrays(batches: Iterable[Batch]) -> int:
    decoders: dict[str, TopicDecoder] = {}
    for batch in batches:
        name = batch.topic.name
        if name not in decoders:
            decoders[name] = TopicDecoder(name, HAND_TOPICS[name.rpartition("/")[2]])
        decoders[name].add(batch)
    return sum(len(decoder.finish()) for decoder in decoders.values())


def _by_index(path: Path) -> int:
    return _arrays(read_batches(path, lambda _: True))


def _by_library(path: Path) -> int:
    return _arrays(gather(mcap_messages(path, lambda _: True, ordered=False)))


def _one_by_one(path: Path) -> int:
    count = 0
    for batch in read_batches(path, lambda _: True):
        store = typestore_of(batch.topic.type)
        for index in range(len(batch.starts)):
            store.deserialize_cdr(batch.message(index), batch.topic.type)
            count += 1
    return count


def _medians(works: Sequence[Callable[[Path], int]], path: Path, rounds: int) -> list[float]:
    """Seconds each piece of work takes: medians of interleaved rounds."""
    times = [[_seconds(work, path) for work in works] for _ in range(rounds)]
    return [statistics.median(column) for column in zip(*times, strict=True)]


def _seconds(work: Callable[[Path], int], path: Path) -> float:
    began = time.perf_counter()
    assert work(path) > 0
    return time.perf_counter() - began


def run(quick: bool) -> list[dict[str, Any]]:
    """Equal arrays first, then interleaved rounds; medians. quick: five seconds of recording instead of ten minutes."""
    with tempfile.TemporaryDirectory() as folder:
        short, path = Path(folder) / "short.mcap", Path(folder) / "bench.mcap"
        make_recording(short, 5.0)
        check_equal(short)
        make_recording(path, 5.0 if quick else 600.0)
        rounds = 2 if quick else 3
        ours, *raw = _medians((_ours, _mcap_raw, _rosbags_raw), path, rounds)
        by_index, by_library = _medians((_by_index, _by_library), path, rounds)
        fixed, one_by_one = _medians((_by_index, _one_by_one), short, rounds)
    size = f"{'5 s' if quick else '10 min'} of 11 joints at 200 Hz in MCAP"
    return [
        figure(f"load {size} into arrays (reference: a library iterates over raw messages)", ours, 1.5, "s", min(raw)),
        figure(
            f"read {size} by its index (reference: message iterator of mcap, same decoder)",
            by_index,
            KEPT,
            "s",
            by_library,
        ),
        figure(
            "read and decode 5 s by fixed layouts (reference: rosbags, message by message)",
            fixed,
            KEPT,
            "s",
            one_by_one,
        ),
    ]
