"""Fixed-layout CDR against rosbags' reading and writing of the same messages, without ROS."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from hand_messages import layouts
from hand_messages.cdr import NS, Layout, LayoutError, RowDecoder
from hand_messages.layouts import MessageSpec

MSG_FOLDER = Path(__file__).parents[2] / "hand_msgs" / "msg"
SPECS = st.sampled_from(layouts.ALL)
TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=9)


def _typestore() -> Typestore:
    store = get_typestore(Stores.ROS2_JAZZY)
    for path in MSG_FOLDER.glob("*.msg"):
        store.register(get_types_from_msg(path.read_text(), f"hand_msgs/msg/{path.stem}"))
    return store


STORE = _typestore()


@st.composite
def cases(draw: st.DrawFn) -> tuple[MessageSpec, Layout, dict[str, Any]]:
    """A spec, a layout with odd names and lengths, and values over the whole range of each type."""
    spec = draw(SPECS)
    names = {f: draw(st.lists(TEXT, max_size=4)) for f, kind in spec.fields if kind == "string[]"}
    numbers = [f for f, kind in spec.fields if kind.endswith("[]") and kind != "string[]"]
    lengths = {f: draw(st.integers(0, 5)) for f in numbers}
    frame = draw(TEXT) if spec.fields[0][1] == "header" else ""
    layout = Layout(spec, frame, names, lengths)
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    values: dict[str, Any] = {}
    for slot in layout.slots:
        if slot.code == "T":
            values[slot.key] = draw(st.integers(-(2**31) * NS, 2**31 * NS - 1))
        elif slot.length is None:
            values[slot.key] = draw(st.integers(0, 2**32 - 1) if slot.code == "I" else st.floats(width=64))
        else:
            data = rng.bytes(slot.length * slot.dtype.itemsize)
            values[slot.key] = (
                np.frombuffer(data, np.uint8) > 99 if slot.code == "?" else np.frombuffer(data, slot.dtype)
            )
    return spec, layout, values


def _message(spec: MessageSpec, layout: Layout, values: dict[str, Any]) -> object:
    """The same content as an object that rosbags serializes."""

    def time(key: str) -> SimpleNamespace:
        return SimpleNamespace(sec=values[key] // NS, nanosec=values[key] % NS)

    fields: dict[str, Any] = {}
    for field, kind in spec.fields:
        if kind == "header":
            fields[field] = SimpleNamespace(stamp=time("stamp_ns"), frame_id=layout.shape.frame_id)
        elif kind in ("time", "duration"):
            fields[field] = time(f"{field}_ns")
        elif kind == "string[]":
            fields[field] = list(layout.shape.names[field])
        else:
            fields[field] = values[field]
    return SimpleNamespace(**fields)


def _given(values: dict[str, Any]) -> dict[str, Any]:
    return {k: v for k, v in values.items() if not (isinstance(v, np.ndarray) and v.size == 0)}


def _padding(layout: Layout) -> Iterator[int]:
    """Offsets of the bytes that belong to no field."""
    used = {i for start, stop in layout.segments for i in range(start, stop)}
    for slot in layout.slots:
        used |= set(range(slot.offset, slot.offset + slot.dtype.itemsize * (1 if slot.length is None else slot.length)))
    return (i for i in range(4, layout.size) if i not in used)


def _same(decoded: Any, value: Any) -> bool:
    decoded = np.asarray(decoded)
    return bool(decoded.tobytes() == np.asarray(value, decoded.dtype).tobytes())


def _decode_rows(layout: Layout, messages: Sequence[bytes]) -> tuple[dict[str, Any], list[bool]]:
    """Values of the messages that have the layout, by key, and which ones they are."""
    decoder = RowDecoder(layout)
    fits = decoder.fits(np.array([len(raw) for raw in messages]))
    packed = b"".join(raw[: decoder.row_size].ljust(decoder.row_size, b"\x00") for raw in messages)
    rows = np.frombuffer(packed, np.uint8).reshape(len(messages), decoder.row_size)
    fits[fits] = decoder.matching(rows[fits])
    return decoder.extract(rows[fits]), fits.tolist()


@given(cases())
def test_encode_writes_the_bytes_that_rosbags_writes(case: tuple[MessageSpec, Layout, dict[str, Any]]) -> None:
    """Breaks when an offset, an alignment, a length or a byte order is wrong."""
    spec, layout, values = case
    assert layout.encode(**_given(values)) == bytes(STORE.serialize_cdr(_message(spec, layout, values), spec.type))


@given(cases(), st.integers(0, 255), st.binary(max_size=15))
def test_decode_returns_what_was_encoded(
    case: tuple[MessageSpec, Layout, dict[str, Any]], garbage: int, spare: bytes
) -> None:
    """Breaks when decode reads elsewhere than encode writes, or trusts undefined or spare bytes."""
    spec, layout, values = case
    raw = bytearray(layout.encode(**_given(values)))
    for offset in _padding(layout):
        raw[offset] = garbage
    message = bytes(raw) + spare
    assert Layout.like(spec, message).shape == layout.shape
    decoded = layout.decode(message)
    columns, rows = _decode_rows(layout, [message, b"", message])
    assert rows == [True, False, True]
    for key, value in values.items():
        assert _same(decoded[key], value), key
        assert _same(columns[key][1], value), key


@given(cases(), st.data())
def test_another_constant_byte_is_another_layout(
    case: tuple[MessageSpec, Layout, dict[str, Any]], data: st.DataObject
) -> None:
    """Breaks when a renamed joint, another length or another frame is taken for the known layout."""
    _, layout, values = case
    raw = bytearray(layout.encode(**_given(values)))
    start, stop = data.draw(st.sampled_from(layout.segments))
    raw[data.draw(st.integers(start, stop - 1))] ^= data.draw(st.integers(1, 255))
    assert not layout.matches(bytes(raw))
    assert _decode_rows(layout, [bytes(raw)])[1] == [False]
    with pytest.raises(LayoutError):
        layout.decode(bytes(raw))


@given(SPECS, st.binary(max_size=200), st.booleans())
def test_like_refuses_arbitrary_bytes(spec: MessageSpec, noise: bytes, headed: bool) -> None:
    """Breaks when a foreign message raises anything but LayoutError, or gives a layout it does not have."""
    raw = b"\x00\x01\x00\x00" + noise if headed else noise
    try:
        layout = Layout.like(spec, raw)
    except LayoutError:
        return
    assert layout.matches(raw)


@given(cases(), st.data())
def test_truncated_messages_are_refused(case: tuple[MessageSpec, Layout, dict[str, Any]], data: st.DataObject) -> None:
    """Breaks when a message cut short is decoded from bytes that are not there."""
    spec, layout, values = case
    raw = layout.encode(**_given(values))
    cut = raw[: data.draw(st.integers(0, len(raw) - 1))]
    assert not layout.matches(cut)
    with pytest.raises(LayoutError):
        Layout.like(spec, cut)


def test_decoded_lists_are_aligned_and_reused() -> None:
    """Breaks when hot-path views are unaligned (numba would compile twice) or allocated per message."""
    layout = Layout(layouts.JOINT_STATE, "hand", ["a", "bcd"])
    zero = {"velocity": np.zeros(2), "effort": np.zeros(2)}
    first = layout.decode(layout.encode(5, position=np.array([1.0, 2.0]), **zero))["position"]
    assert first.flags.aligned
    layout.decode(layout.encode(6, position=np.array([3.0, 4.0]), **zero))
    assert first.tolist() == [3.0, 4.0]


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"stamp_ns": 1}, "needs"),
        ({"stamp_ns": 1, "pressure": [1.0, 2.0], "force": [1.0, 2.0]}, "force"),
        ({"stamp_ns": 1, "pressure": [1.0]}, "1 values, needs 2"),
        ({"stamp_ns": 2**31 * NS, "pressure": [1.0, 2.0]}, "stamp_ns"),
    ],
)
def test_encode_refuses_incomplete_values(values: dict[str, Any], reason: str) -> None:
    """Breaks when a missing, foreign, ill-sized or out-of-range value goes out, or an old one goes out again."""
    layout = Layout(layouts.JOINT_PRESSURES, "", ["a", "b"])
    with pytest.raises(LayoutError, match=reason):
        layout.encode(**values)


def test_layout_refuses_unknown_and_missing_lists() -> None:
    """Breaks when a misspelt field is ignored or the length of a list is guessed."""
    with pytest.raises(LayoutError, match="no such list: forces"):
        Layout(layouts.CONTACT_FORCES, "", ["a"], {"forces": 1})
    with pytest.raises(LayoutError, match="length of channel, counts"):
        Layout(layouts.ADC_FRAME)


@pytest.mark.parametrize("spec", layouts.ALL, ids=lambda spec: spec.type)
def test_specs_agree_with_the_definitions(spec: MessageSpec) -> None:
    """Breaks when a table of fields and its .msg file part ways."""
    text, _ = STORE.generate_msgdef(spec.type, ros_version=2)
    spelled = {
        "header": "std_msgs/Header",
        "time": "builtin_interfaces/Time",
        "duration": "builtin_interfaces/Duration",
    }
    expected = "\n".join(f"{spelled.get(kind, kind)} {field}" for field, kind in spec.fields)
    assert text.split("\n=")[0].strip() == expected
