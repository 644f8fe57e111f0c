"""Recordings of a small hand, made without ROS, for the tests of this folder."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hand_messages import layouts
from hand_messages.cdr import Layout
from hand_recording.bag_writer import BagWriter, Topic, open_bag
from hand_recording.loader import HAND_TOPICS

ROOT = Path(__file__).parents[2]
JOINTS = ("index_proximal", "index_distal", "thumb_opposition")
START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 5_000_000

Write = Callable[..., Path]


def values_of(layout: Layout, stamp_ns: int, rng: np.random.Generator) -> dict[str, Any]:
    """Random values for every slot; NaN among the floats."""
    values: dict[str, Any] = {}
    for slot in layout.slots:
        count = slot.length or 1
        if slot.length == 0:
            continue
        if slot.code == "T":
            sample: Any = [stamp_ns if slot.key != "lifetime_ns" else 100_000_000]
        elif slot.key == "channel":
            sample = list(range(count))
        elif slot.code == "?":
            sample = rng.random(count) > 0.5
        elif slot.code == "d":
            sample = np.where(rng.random(count) > 0.1, rng.normal(size=count), np.nan)
        else:
            sample = rng.integers(0, 4096, count)
        values[slot.key] = sample if slot.length is not None else sample[0]
    return values


def fill(bag: BagWriter, ticks: int, space: str = "/hand", seed: int = 0) -> None:
    """Every topic of a hand, `ticks` samples each, 5 ms apart; sent 1 ms after the stamp, logged 2 ms after it."""
    rng = np.random.default_rng(seed)
    table = []
    for suffix, spec in HAND_TOPICS.items():
        adc = spec is layouts.ADC_FRAME
        lengths = {"channel": 7, "counts": 7} if adc else {"effort": 0} if suffix == "joint_commands" else None
        bag.add_topic(Topic.of(f"{space}/{suffix}", spec.type))
        table.append((f"{space}/{suffix}", Layout(spec, "hand", () if adc else JOINTS, lengths)))
    for tick in range(ticks):
        stamp_ns = START_NS + tick * PERIOD_NS
        for name, layout in table:
            raw = layout.encode(**values_of(layout, stamp_ns, rng))
            bag.write(name, raw, stamp_ns + 2_000_000, stamp_ns + 1_000_000, tick + 1)
        bag.tick(stamp_ns)


@pytest.fixture
def make_bag(tmp_path: Path) -> Write:
    """Writes a recording and returns its path: make_bag(name, storage="mcap", ticks=100)."""

    def make(name: str = "bag", storage: str = "mcap", ticks: int = 100) -> Path:
        bag = open_bag(tmp_path / name, storage)
        fill(bag, ticks)
        bag.close()
        return tmp_path / name

    return make


@pytest.fixture(scope="session")
def ros_environment() -> dict[str, str]:
    """Environment of ROS processes: a domain of this test process, this checkout importable."""
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    path = os.pathsep.join([str(ROOT), *sys.path])
    return os.environ | {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(1 + os.getpid() % 100),
        "PYTHONPATH": path,
    }
