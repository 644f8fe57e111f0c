"""One message of the hand as bytes: the fixed layout against rclpy's own serialization, per message.

The reference builds the message from arrays, as a node would, and calls serialize_message; it decodes with
deserialize_message and takes the numbers out as arrays. Each side reads the other's bytes and gets the same numbers.
The fixed layout is kept as long as it takes at most a third of the reference's time.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from hand_messages.cdr import Layout
from hand_messages.layouts import JOINT_STATE
from hand_model.arrays import Array
from validation.bench.bench_loader import JOINTS
from validation.bench.result import figure

GOAL = 1.0 / 3.0
STAMP_NS = 1_700_000_000_123_456_789


class _Rclpy:
    """The reference: a message object that is filled again for each sample."""

    def __init__(self) -> None:
        self._message = JointState(name=list(JOINTS))
        self._message.header.frame_id = "hand"

    def encode(self, stamp_ns: int, position: Array, velocity: Array, effort: Array) -> bytes:
        stamp = self._message.header.stamp
        stamp.sec, stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
        self._message.position = position.tolist()
        self._message.velocity = velocity.tolist()
        self._message.effort = effort.tolist()
        return bytes(serialize_message(self._message))

    @staticmethod
    def decode(raw: bytes) -> dict[str, Any]:
        message = deserialize_message(raw, JointState)
        stamp = message.header.stamp
        return {
            "stamp_ns": stamp.sec * 1_000_000_000 + stamp.nanosec,
            "position": np.array(message.position),
            "velocity": np.array(message.velocity),
            "effort": np.array(message.effort),
        }


def run(quick: bool) -> list[dict[str, Any]]:
    """Equality first, then interleaved rounds; medians of the time per message [us]."""
    rng = np.random.default_rng(0)
    lists = {key: rng.normal(size=len(JOINTS)) for key in ("position", "velocity", "effort")}
    layout, reference = Layout(JOINT_STATE, "hand", JOINTS), _Rclpy()
    raw = layout.encode(STAMP_NS, **lists)
    for message in (raw, reference.encode(STAMP_NS, **lists)):  # bytes skipped by alignment are undefined
        ours, theirs = layout.decode(message), reference.decode(message)
        assert all(np.array_equal(ours[key], theirs[key]) for key in theirs)
        assert np.array_equal(theirs["position"], lists["position"])
    rounds, count = (5, 2_000) if quick else (15, 20_000)
    work: dict[str, tuple[Callable[[], Any], Callable[[], Any]]] = {
        "encode": (lambda: layout.encode(STAMP_NS, **lists), lambda: reference.encode(STAMP_NS, **lists)),
        "decode": (lambda: layout.decode(raw), lambda: reference.decode(raw)),
    }
    results = []
    for name, pair in work.items():
        times = [[_microseconds(side, count) for side in pair] for _ in range(rounds)]
        medians = [statistics.median(column) for column in zip(*times, strict=True)]
        label = f"{name} one joint_states message of 11 joints (reference: rclpy)"
        results.append(figure(label, medians[0], GOAL, "us", medians[1]))
    return results


def _microseconds(work: Callable[[], Any], count: int) -> float:
    began = time.perf_counter()
    for _ in range(count):
        work()
    return (time.perf_counter() - began) / count * 1e6
