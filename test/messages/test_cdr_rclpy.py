"""Fixed-layout CDR against rclpy's own serializer, over every message of the hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hand_messages import layouts
from hand_messages.cdr import NS, Layout
from hand_messages.layouts import MessageSpec

pytest.importorskip("rclpy", reason="rclpy is not installed")
from hand_msgs.msg import AdcFrame, ContactForces, ControllerState, JointPressures, ValveCommand
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

CLASSES = dict(
    zip(
        (spec.type for spec in layouts.ALL),
        (JointState, JointPressures, ContactForces, AdcFrame, ValveCommand, ControllerState, Clock),
        strict=True,
    )
)
NAMES = (
    ("index_proximal", "thumb_opposition", "x"),
    ("left_index_proximal", "", "little_distal", "ü"),
    ("a", "ab", "abc", "abcd", "abcde", "abcdef", "abcdefg"),
    (),
)


def _filled(spec: MessageSpec, names: tuple[str, ...], seed: int) -> Any:
    """A message object with random content under these names."""
    rng = np.random.default_rng(seed)
    message = CLASSES[spec.type]()
    for field, kind in spec.fields:
        value = getattr(message, field)
        if kind == "header":
            value.frame_id, value = "hand"[: seed % 5], value.stamp
        if kind in ("header", "time", "duration"):
            value.sec, value.nanosec = int(rng.integers(-(2**31), 2**31)), int(rng.integers(0, NS))
        elif kind == "string[]":
            setattr(message, field, list(names))
        elif kind == "bool[]":
            setattr(message, field, (rng.random(len(names)) > 0.5).tolist())
        elif kind == "float64[]":
            setattr(message, field, rng.normal(size=len(names)))
        elif kind.endswith("[]"):
            setattr(message, field, rng.integers(0, 2**16, len(names)).tolist())
        else:
            setattr(message, field, 7 if kind == "uint32" else float(rng.normal()))
    return message


def _values(spec: MessageSpec, message: Any) -> dict[str, Any]:
    """The message's numbers under the codec's keys, without empty lists."""
    values: dict[str, Any] = {}
    for field, kind in spec.fields:
        value = getattr(message, field)
        if kind in ("header", "time", "duration"):
            time = value.stamp if kind == "header" else value
            values["stamp_ns" if kind == "header" else f"{field}_ns"] = time.sec * NS + time.nanosec
        elif kind != "string[]" and not (kind.endswith("[]") and len(value) == 0):
            values[field] = value
    return values


@pytest.mark.parametrize("names", NAMES, ids=len)
@pytest.mark.parametrize("spec", layouts.ALL, ids=lambda spec: spec.type)
def test_bytes_agree_with_rclpy(spec: MessageSpec, names: tuple[str, ...]) -> None:
    """Breaks when a defined byte differs from what rclpy writes, or either side misreads the other."""
    for seed in range(5):
        message = _filled(spec, names, seed)
        theirs = serialize_message(message)
        layout = Layout.like(spec, theirs)
        ours = layout.encode(**_values(spec, message))
        assert deserialize_message(ours, CLASSES[spec.type]) == message
        for key, value in layout.decode(theirs).items():
            expected = _values(spec, message).get(key, ())
            assert np.asarray(value).tolist() == (expected if np.isscalar(expected) else list(expected)), key
        for start, stop in layout.segments:
            assert ours[start:stop] == theirs[start:stop]
        for slot in layout.slots:
            stop = slot.offset + slot.dtype.itemsize * (1 if slot.length is None else slot.length)
            assert ours[slot.offset : stop] == theirs[slot.offset : stop], slot.key
