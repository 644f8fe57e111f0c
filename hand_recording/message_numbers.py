"""Numbers inside the messages of a recording by their paths, such as `/joint_states.position[elbow]`.

A path is the name of a topic, then fields after points, and elements of lists in brackets: by their number from 0, or
by the name that the same message lists for them. Every message type is read that the recording defines, or that is
known here. Times are those of the headers where the messages have one, else the times at which they were sent.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from hand_model.arrays import Array
from hand_recording.batches import RawMessage, RawTopic
from hand_recording.interpolation import on_clock
from hand_recording.message_types import UnknownType, typestore_of
from hand_recording.reading import iter_raw, list_topics
from hand_recording.recording_files import RecordingError
from hand_recording.settings import READING

NS = 1_000_000_000
PATH = re.compile(r"(?P<topic>/[^.\[\]\s]*)(?P<parts>(?:\.[A-Za-z]\w*|\[[^\[\]]+\])+)")
PART = re.compile(r"\.([A-Za-z]\w*)|\[([^\[\]]+)\]")
NAMES = ("name", "names", "joint_names", "interface_names")
"""Fields of a message that name the elements of its lists."""
MOST_ELEMENTS = 32
"""Elements of a list that are proposed at most."""
CLOCK = "/clock"
DECODING = (SerdeError, AssertionError, IndexError, KeyError, TypeError, ValueError, struct.error)
"""What rosbags raises for bytes of another type."""


@dataclass(frozen=True, slots=True)
class Series:
    """A number of the messages of a topic. time_s, values: (n,) in the order of the recording.

    notes: lines about messages that do not decode, and about times that are not those of the headers.
    """

    time_s: Array
    values: Array
    notes: tuple[str, ...] = ()


def is_recording(path: Path) -> bool:
    """Whether a file or folder is a rosbag2 recording and not a table."""
    return path.is_dir() or path.suffix in {".mcap", ".db3", ".zstd"}


def topic_of(name: str) -> str:
    """The topic of the path of a number."""
    return re.split(r"[.\[]", name, maxsplit=1)[0]


def read_series(path: Path, names: Iterable[str], *, of_headers: bool = True) -> dict[str, Series]:
    """Numbers of a recording by their paths, all on one clock, which begins near 0.

    path: see reading.iter_raw.  of_headers: whether times in headers are used.
    Raises RecordingError, one line, for a recording that cannot be read, and a topic, field or element it lacks.
    """
    parts = {name: _split(path, name) for name in names}
    declared = {topic.name: topic for topic in list_topics(path)}
    by_topic: dict[str, list[str]] = {}
    for name in parts:
        by_topic.setdefault(topic_of(name), []).append(name)
    for topic in by_topic:
        if topic not in declared:
            raise RecordingError(f"{path} has no topic {topic}; it has: {_listing(declared)}")
    readers = {topic: _Reader(path, declared[topic]) for topic in by_topic}
    tracks = {name: _Track(own, of_headers=of_headers) for name, own in parts.items()}
    clock = _Clock(path, declared.get(CLOCK))
    for message in iter_raw(path, lambda topic: topic.name in readers or topic.name == CLOCK):
        clock.add(message)
        content = readers[message.topic.name].read(message) if message.topic.name in readers else None
        if content is not None:
            for name in by_topic[message.topic.name]:
                tracks[name].add(content, message)
    for name, track in tracks.items():
        readers[topic_of(name)].check(name, track)
    times, notes = _on_one_clock(tracks, clock)
    return {
        name: Series(times[name], np.array(track.values), (*notes, *readers[topic_of(name)].notes))
        for name, track in tracks.items()
    }


def list_numbers(path: Path) -> dict[str, str]:
    """Paths of the numbers in the first message of every topic, and the type of each topic's messages.

    Raises RecordingError where the recording cannot be read.
    """
    found: dict[str, str] = {}
    first: dict[str, RawMessage] = {}
    declared = {topic.name for topic in list_topics(path)}
    for message in iter_raw(path):
        first.setdefault(message.topic.name, message)
        if len(first) == len(declared):
            break
    for name, message in first.items():
        try:
            content = _Reader(path, message.topic).read(message)
        except RecordingError:
            continue  # a type that nobody defines
        if content is not None:
            found |= dict.fromkeys((f"{name}{parts}" for parts in _numbers(content, ())), message.topic.type)
    return found


def _split(path: Path, name: str) -> tuple[str, ...]:
    """Parts of the path of a number behind its topic: each with its point, or the text within brackets."""
    found = PATH.fullmatch(name)
    if found is None:
        raise RecordingError(
            f"{path}: {name!r} is not a number of a message; write /topic.field or /topic.field[element],"
            " for example /joint_states.position[elbow]"
        )
    return tuple(f".{field}" if field else element for field, element in PART.findall(found["parts"]))


class _Reader:
    """Decodes the messages of a topic."""

    def __init__(self, path: Path, topic: RawTopic) -> None:
        """Raises RecordingError where nobody defines the type of the topic."""
        self.where, self.kind, self.unread = f"{path}: {topic.name}", topic.type, 0
        try:
            self._store = _store(topic)
        except (TypesysError, UnknownType) as error:
            raise RecordingError(f"{path}: {topic.name} cannot be read: {error}") from None

    def read(self, message: RawMessage) -> Any:
        """The content of a message; None where it does not decode."""
        try:
            return self._store.deserialize_cdr(message.raw, self.kind)
        except DECODING:
            self.unread += 1
            return None

    @property
    def notes(self) -> tuple[str, ...]:
        """A line about messages that do not decode."""
        return (f"{self.unread} messages do not decode as {self.kind}; left out",) if self.unread else ()

    def check(self, name: str, track: _Track) -> None:
        """Raises RecordingError where a path has no number in any message, or more than READING.max_samples."""
        if track.values and len(track.values) <= READING.max_samples:
            return
        if track.values:
            raise RecordingError(
                f"{self.where} has {len(track.values)} messages; the allowed range is up to {READING.max_samples};"
                " cut it into several recordings"
            )
        if track.wrong:
            raise RecordingError(f"{self.where}, of type {self.kind}, has no number {name!r}: {track.wrong}")
        none = "holds no message" if not self.unread else f"has {self.unread} messages, and none decodes"
        raise RecordingError(f"{self.where} {none}")


def _store(topic: RawTopic) -> Typestore:
    """The types as the recording defines them, else as they are known here."""
    if not topic.definition:
        return typestore_of(topic.type)
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(topic.definition, topic.type))
    return store


class _Track:
    """A number of the messages of a topic, as they are read. stamp_ns: 0 where a message has no time."""

    def __init__(self, parts: Sequence[str], *, of_headers: bool) -> None:
        self.values: list[float] = []
        self.stamp_ns: list[int] = []
        self.sent_ns: list[int] = []
        self.wrong = ""
        self._parts, self._of_headers = parts, of_headers

    def add(self, content: Any, message: RawMessage) -> None:
        """Keep the number of a message; one that lacks the element has none, as of another robot's joint."""
        try:
            self.values.append(_number(content, self._parts))
        except LookupError as error:
            self.wrong = str(error.args[0])
            return
        header = getattr(content, "header", None) if self._of_headers else None
        self.stamp_ns.append(_nanoseconds(getattr(header, "stamp", None)))
        self.sent_ns.append(message.publish_ns or message.log_ns)

    @property
    def is_stamped(self) -> bool:
        """Whether all of its headers have a time."""
        return all(self.stamp_ns)


class _Clock:
    """Times of sending [ns] of the ticks of /clock, and what they show [ns]."""

    def __init__(self, path: Path, topic: RawTopic | None) -> None:
        self.sent_ns: list[int] = []
        self.shown_ns: list[int] = []
        self._reader = _Reader(path, topic) if topic is not None else None

    def add(self, message: RawMessage) -> None:
        """Keep a message if it is a tick."""
        if self._reader is not None and message.topic.name == CLOCK:
            content = self._reader.read(message)
            if content is not None and hasattr(content, "clock"):
                self.shown_ns.append(_nanoseconds(content.clock))
                self.sent_ns.append(message.publish_ns or message.log_ns)

    def shown_at(self, sent_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """What it showed [ns] at times of sending (n,) [ns]."""
        return on_clock(sent_ns, np.array(self.sent_ns, dtype=np.int64), np.array(self.shown_ns, dtype=np.int64))


def _nanoseconds(time: Any) -> int:
    """A time of a message [ns]; 0 where there is none."""
    return int(time.sec) * NS + int(time.nanosec) if hasattr(time, "nanosec") else 0


def _on_one_clock(tracks: Mapping[str, _Track], clock: _Clock) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Times (n,) [s] of every track after the first of all, and a line where they are not those of the headers.

    Where headers have another clock than the times of sending, as in a simulation, /clock converts the latter.
    """
    stamped = {name for name, track in tracks.items() if track.is_stamped}
    late_ns = [np.median(np.subtract(tracks[name].sent_ns, tracks[name].stamp_ns)) for name in stamped]
    mixed = 0 < len(stamped) < len(tracks)
    foreign = mixed and max(map(abs, late_ns)) > READING.foreign_clock_ns
    notes: tuple[str, ...] = ()
    if foreign and len(clock.sent_ns) < 2:
        stamped, foreign = set(), False
        notes = ("headers have another clock than the times of sending, and there is no /clock; the latter are used",)
    times = {}
    for name, track in tracks.items():
        own = np.array(track.stamp_ns if name in stamped else track.sent_ns, dtype=np.int64)
        times[name] = clock.shown_at(own) if foreign and name not in stamped else own
    # As seconds since 1970, times would be rounded to 0.2 us.
    base = min(int(each.min()) for each in times.values())
    return {name: (each - base) / NS for name, each in times.items()}, notes


def _number(content: Any, parts: Sequence[str]) -> float:
    """The number at a path in a message. Raises LookupError that says what is there instead."""
    here, around = content, content
    for part in parts:
        if part.startswith("."):
            if not hasattr(here, "__msgtype__") or not hasattr(here, part[1:]):
                raise LookupError(f"{_described(here)} and no field {part[1:]}")
            around, here = here, getattr(here, part[1:])
        else:
            here = _element(here, around, part)
    if isinstance(here, (bool, int, float, np.generic)):
        return float(here)
    raise LookupError(f"the path ends at {_described(here)}")


def _element(values: Any, message: Any, part: str) -> Any:
    """An element of a list, by its number or by the name that the message around it has for it."""
    if not isinstance(values, (list, np.ndarray)):
        raise LookupError(f"[{part}] follows {_described(values)}, which is no list")
    names = next((list(own) for key in NAMES if isinstance(own := getattr(message, key, None), list)), [])
    if part in names:
        index = names.index(part)
    elif re.fullmatch(r"\d+", part):
        index = int(part)
    else:
        listed = f"its names are {_listing(names)}" if names else "the message names no elements, only numbers count"
        raise LookupError(f"there is no element {part}; {listed}")
    if index >= len(values):
        raise LookupError(f"its list has {len(values)} elements, numbered from 0, and no [{part}]")
    return values[index]


def _described(value: Any) -> str:
    if hasattr(value, "__msgtype__"):
        return f"a {value.__msgtype__} with the fields {_listing(_fields(value))}"
    return f"a list of {len(value)}" if isinstance(value, (list, np.ndarray)) else f"a {type(value).__name__}"


def _fields(message: Any) -> list[str]:
    return [key for key in message.__dataclass_fields__ if key != "__msgtype__"]


def _numbers(content: Any, names: Sequence[str]) -> Iterator[str]:
    """Paths of all numbers below a message or list; times and layouts have none of interest."""
    if isinstance(content, (bool, int, float, np.generic)):
        yield ""
    elif hasattr(content, "__msgtype__"):
        listed = next((list(own) for key in NAMES if isinstance(own := getattr(content, key, None), list)), [])
        for field in _fields(content):
            if field not in ("header", "layout", "stamp"):
                yield from (f".{field}{rest}" for rest in _numbers(getattr(content, field), listed))
    elif isinstance(content, (list, np.ndarray)):
        unique = len(set(names)) == len(names) == len(content)
        for index, value in enumerate(content[:MOST_ELEMENTS]):
            own = names[index] if unique and not re.search(r"[\[\]]", names[index]) else str(index)
            yield from (f"[{own}]{rest}" for rest in _numbers(value, ()))


def _listing(names: Iterable[str]) -> str:
    items = [str(name) for name in names]
    return ", ".join(items[:8]) + (", ..." if len(items) > 8 else "") if items else "none"
