"""Loading a recording into arrays, against the libraries' bare handing over of its raw messages.

The recording: 10 minutes of 11 joints at 200 Hz in MCAP, six topics, as the recorder writes it. The reference is the
faster of two library loops that only iterate over raw messages: mcap's reader and rosbags' reader.
"""

from __future__ import annotations

import json
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

from hand_messages import layouts
from hand_messages.cdr import Layout
from hand_recording.bag_writer import Topic, open_bag
from hand_recording.loader import HAND_TOPICS, load_recording
from hand_recording.message_types import typestore_of

FINGERS = ("thumb", "index", "middle", "ring", "little")
JOINTS = (*(f"{finger}_{part}" for finger in FINGERS for part in ("proximal", "distal")), "thumb_opposition")
RATE_HZ = 200
TOPICS = ("joint_states", "pressures", "contact_forces", "adc", "valve_command", "controller_state")
START_NS = 1_700_000_000_000_000_000


def make_recording(path: Path, seconds: float) -> None:
    """A bare MCAP file of every topic at RATE_HZ with noisy numbers."""
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


def _seconds(work: Callable[[Path], int], path: Path) -> float:
    began = time.perf_counter()
    assert work(path) > 0
    return time.perf_counter() - began


def run(quick: bool) -> list[dict[str, Any]]:
    """Equality first, then interleaved rounds; medians. quick: a minute of recording instead of ten."""
    with tempfile.TemporaryDirectory() as folder:
        short, path = Path(folder) / "short.mcap", Path(folder) / "bench.mcap"
        make_recording(short, 5.0)
        check_equal(short)
        make_recording(path, 60.0 if quick else 600.0)
        times: dict[str, list[float]] = {"ours": [], "mcap": [], "rosbags": []}
        for _ in range(5 if quick else 3):
            times["ours"].append(_seconds(_ours, path))
            times["mcap"].append(_seconds(_mcap_raw, path))
            times["rosbags"].append(_seconds(_rosbags_raw, path))
    medians = {name: statistics.median(values) for name, values in times.items()}
    ours, reference = medians["ours"], min(medians["mcap"], medians["rosbags"])
    name = f"load {1 if quick else 10} min, 11 joints, 200 Hz MCAP into arrays / library hands over raw messages"
    return [{"name": name, "ours": ours, "reference": reference, "ratio": ours / reference, "goal": 1.5, "unit": "s"}]


if __name__ == "__main__":
    print(json.dumps(run(quick="--quick" in sys.argv), indent=2))
