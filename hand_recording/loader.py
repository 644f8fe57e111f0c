"""A recording as NumPy arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hand_messages import layouts
from hand_recording.batches import RawTopic
from hand_recording.columns import TopicData, TopicDecoder
from hand_recording.message_types import same_definition
from hand_recording.reading import iter_raw, list_topics, read_batches
from hand_recording.recording_files import RecordingError
from hand_recording.time_base import TimeBase, resample

__all__ = ["Recording", "RecordingError", "TimeBase", "TopicData", "iter_raw", "load_recording"]

HAND_TOPICS = {
    "joint_states": layouts.JOINT_STATE,
    "pressures": layouts.JOINT_PRESSURES,
    "contact_forces": layouts.CONTACT_FORCES,
    "adc": layouts.ADC_FRAME,
    "valve_command": layouts.VALVE_COMMAND,
    "controller_state": layouts.CONTROLLER_STATE,
    "joint_commands": layouts.JOINT_STATE,
}
CLOCK = "/clock"


@dataclass(frozen=True)
class Recording:
    """The topics of one hand by the last part of their names; `clock` is among them where the time was simulated."""

    path: Path
    namespace: str
    topics: dict[str, TopicData]

    def __getitem__(self, topic: str) -> TopicData:
        """A topic. Raises RecordingError where the recording does not have it."""
        if topic not in self.topics:
            raise RecordingError(f"{self.path} has no topic {self.namespace}/{topic}")
        return self.topics[topic]

    def __contains__(self, topic: str) -> bool:
        """Whether the recording has the topic."""
        return topic in self.topics

    def on_time_base(
        self,
        period_s: float | None = None,
        stamps_ns: NDArray[np.int64] | None = None,
        joints: Sequence[str] | None = None,
        max_gap_s: float = 0.1,
    ) -> TimeBase:
        """Every signal on one time base, by the rules of time_base.py.

        period_s: distance of the samples [s]; or stamps_ns: rising times (T,) [ns]; without both, the stamps of
        joint_states are used.  joints: order of the columns (default: that of joint_states).
        max_gap_s: longest distance of two samples that are joined by a straight line [s].
        Raises RecordingError where the recording has none of the joints, or the times are not valid.
        """
        return resample(self.path, self.topics, period_s, stamps_ns, joints, max_gap_s)


def load_recording(path: Path, namespace: str | None = None) -> Recording:
    """Load the topics of one hand: a rosbag2 folder, or a bare .mcap or .db3 file.

    namespace: of the hand to load, needed where several were recorded.  SQLite3 keeps no publish times: publish_ns
    then equals log_ns.  Raises RecordingError, one line that names the file and the problem.
    """
    path = Path(path)
    declared = list_topics(path)
    space = _namespace(path, declared, namespace)
    decoders = {
        f"{space}/{suffix}": TopicDecoder(f"{path}: {space}/{suffix}", spec) for suffix, spec in HAND_TOPICS.items()
    }
    decoders[CLOCK] = TopicDecoder(f"{path}: {CLOCK}", layouts.CLOCK)
    for topic in declared:
        if topic.name in decoders:
            _check_type(path, topic)
    present = {topic.name for topic in declared} & decoders.keys()
    for batch in read_batches(path, lambda topic: topic.name in present):
        decoders[batch.topic.name].add(batch)
    topics = {name.rsplit("/", 1)[-1]: decoders[name].finish() for name in decoders if name in present}
    if not any(len(topic) for topic in topics.values()):
        raise RecordingError(f"{path} holds no message of the hand {space or '/'}")
    return Recording(path, space, topics)


def _namespace(path: Path, declared: Sequence[RawTopic], wanted: str | None) -> str:
    """The namespace to load, without a slash at its end."""
    spaces: dict[str, int] = {}
    for topic in declared:
        space, _, suffix = topic.name.rpartition("/")
        if suffix in HAND_TOPICS:
            spaces[space] = spaces.get(space, 0) + 1
    if wanted is not None:
        wanted = "/" + wanted.strip("/") if wanted.strip("/") else ""
        if wanted not in spaces:
            raise RecordingError(f"{path} holds no hand {wanted or '/'}; it has: {_listing(spaces)}")
        return wanted
    if not spaces:
        names = [topic.name for topic in declared]
        raise RecordingError(f"{path} holds none of {_listing(HAND_TOPICS)}; it has: {_listing(names)}")
    if len(spaces) > 1:
        raise RecordingError(f"{path} holds several hands: {_listing(spaces)}; name one of these namespaces")
    return next(iter(spaces))


def _listing(names: object) -> str:
    items = [str(name) or "/" for name in names] if isinstance(names, (list, dict)) else []
    return ", ".join(items[:8]) + (", ..." if len(items) > 8 else "") if items else "nothing"


def _check_type(path: Path, topic: RawTopic) -> None:
    """Raises RecordingError where a topic of a hand has another type, or another version of it, than expected."""
    spec = layouts.CLOCK if topic.name == CLOCK else HAND_TOPICS[topic.name.rpartition("/")[2]]
    if topic.type != spec.type:
        raise RecordingError(f"{path}: {topic.name} is {topic.type or 'of no type'}, not {spec.type}")
    if topic.definition and not same_definition(topic.type, topic.definition):
        raise RecordingError(f"{path}: {topic.name} was recorded with another version of {topic.type}")
