"""Every signal of a recording on one time base.

Rules:
- Times are header stamps. Measured signals (position, velocity, effort, pressure, force) are interpolated linearly
  between the two samples around a time (interpolation.py). They are NaN before the first sample, after the last, and
  inside gaps longer than max_gap_s. A time that equals a stamp gets that very sample.
- reference (controller_state) holds from its stamp until the next sample. It is NaN before the first sample, and
  where the last one is older than max_gap_s.
- valve_command holds from its publish time, not from its stamp, because the board cannot have received it before.
  After its lifetime the board vents: 0 Pa until the next command. It is NaN before the first command.
- Under simulated time (/clock was recorded) publish times are converted to that clock, linearly between two ticks.
- Publish times of a recording that was played without /clock and recorded again are moved back by the offset, and
  divided by the rate, that the frames of joint_states show.
- Of samples that share a stamp the last one counts. Samples are sorted by their stamps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array
from hand_recording.columns import TopicData
from hand_recording.interpolation import in_force, in_order, interpolate, on_clock
from hand_recording.recording_files import RecordingError
from hand_recording.settings import READING

Times = NDArray[np.int64]
NS = 1_000_000_000


@dataclass(frozen=True, kw_only=True)
class TimeBase:
    """Signals at T times of J joints; NaN where a signal is not known. Every array is (T, J), force is (T, sites).

    time_ns: (T,) int64, header clock.  position, reference [rad]; velocity [rad/s]; effort [N.m]; pressure and
    valve_command [Pa gauge]; force [N].
    """

    time_ns: Times
    joints: tuple[str, ...]
    sites: tuple[str, ...]
    position: Array
    velocity: Array
    effort: Array
    pressure: Array
    force: Array
    valve_command: Array
    reference: Array

    @property
    def time_s(self) -> Array:
        """Seconds since the first time."""
        return (self.time_ns - self.time_ns[:1]) / NS


def resample(
    path: Path,
    topics: Mapping[str, TopicData],
    period_s: float | None,
    stamps_ns: Times | None,
    joints: Sequence[str] | None,
    max_gap_s: float,
) -> TimeBase:
    """See Recording.on_time_base."""
    states = topics.get("joint_states")
    if joints is None and states is None:
        raise RecordingError(f"{path} has no joint_states: name the joints")
    columns = tuple(states.names if joints is None and states else joints or ())
    known = {name for topic in topics.values() for name in topic.names}
    if not known & set(columns):
        raise RecordingError(f"{path} has none of the joints {', '.join(columns)}")
    times = _times(path, topics, period_s, stamps_ns)
    forces = topics.get("contact_forces")
    sites = forces.names if forces else ()
    gap_ns = round(max_gap_s * NS)

    def measured(topic: str, field: str, names: Sequence[str] = columns) -> Array:
        data = topics.get(topic)
        if data is None or not len(data):
            return np.full((len(times), len(names)), np.nan)
        stamps, rows = in_order(data.stamp_ns)
        return interpolate(times, stamps, _named(data, field, names)[rows], gap_ns)

    return TimeBase(
        time_ns=times,
        joints=columns,
        sites=tuple(sites),
        position=measured("joint_states", "position"),
        velocity=measured("joint_states", "velocity"),
        effort=measured("joint_states", "effort"),
        pressure=measured("pressures", "pressure"),
        force=measured("contact_forces", "force", sites),
        valve_command=_valve_command(times, topics, columns),
        reference=_reference(times, topics, columns, gap_ns),
    )


def nearest(times: Times, data: TopicData, field: str, names: Sequence[str], most_ns: float) -> tuple[Array, Array]:
    """The sample of a field nearest to each time (T, J), and its time minus that time (T,) [ns].

    most_ns: largest deviation of that difference from its median; samples farther away are NaN.
    """
    stamps, rows = in_order(data.stamp_ns)
    at = np.clip(np.searchsorted(stamps, times), 1, len(stamps) - 1)
    at -= times - stamps[at - 1] < stamps[at] - times
    late = (stamps[at] - times).astype(np.float64)
    values = _named(data, field, names)[rows[at]]
    values[np.abs(late - np.median(late)) >= most_ns] = np.nan
    return values, late


def _held(
    times: Times, data: TopicData | None, field: str, joints: Sequence[str], starts: Times | None
) -> tuple[Array, Times, NDArray[np.intp]]:
    """A field held from `starts`, (T, J), its age at each time [ns] (-1 before the first), and its rows."""
    if data is None or not len(data) or starts is None:
        return np.full((len(times), len(joints)), np.nan), np.full(len(times), -1), np.zeros(0, np.intp)
    starts, rows = in_order(starts)
    row = in_force(times, starts)
    values = _named(data, field, joints)[rows[row]]
    values[row < 0] = np.nan
    return values, np.where(row < 0, -1, times - starts[row]), rows[row]


def _valve_command(times: Times, topics: Mapping[str, TopicData], joints: Sequence[str]) -> Array:
    data = topics.get("valve_command")
    starts = published_on_stamp_clock(topics) if data is not None else None
    command, age, rows = _held(times, data, "pressure", joints, starts)
    if data is not None and len(data):
        command[age > data["lifetime_ns"][rows]] = 0.0
    return command


def _reference(times: Times, topics: Mapping[str, TopicData], joints: Sequence[str], max_gap_ns: int) -> Array:
    data = topics.get("controller_state")
    starts = data.stamp_ns if data is not None else None
    reference, age, _ = _held(times, data, "reference", joints, starts)
    reference[age > max_gap_ns] = np.nan
    return reference


def published_on_stamp_clock(topics: Mapping[str, TopicData]) -> Times:
    """Publish time of each valve command [ns], on the clock of the headers.

    Publish times that lie far from the stamps are those of a played recording, which was recorded again.
    """
    commands = topics["valve_command"]
    sent = _on_stamp_clock(commands.publish_ns, topics.get("clock"))
    if not len(sent) or abs(float(np.median(sent - commands.stamp_ns))) <= READING.foreign_clock_ns:
        return sent
    return _on_played_clock(commands, topics.get("joint_states"))


def _on_stamp_clock(publish_ns: Times, clock: TopicData | None) -> Times:
    """Publish times, converted to the clock of the stamps between the ticks of /clock around them."""
    if clock is None or not len(clock):
        return publish_ns
    return on_clock(publish_ns, clock.publish_ns, clock.stamp_ns)


def _on_played_clock(commands: TopicData, states: TopicData | None) -> Times:
    """Publish times of a recording that was played and recorded again, on the clock of the stamps.

    The player keeps the distances of the messages, so that the frames of joint_states give offset and rate of the
    clocks. Of their delays a small one counts, because a busy host delays some. Without frames the stamps are used.
    """
    if states is None or len(states) < 2 or np.ptp(states.stamp_ns) == 0:
        return commands.stamp_ns
    first_stamp, first_sent = int(states.stamp_ns[0]), int(states.publish_ns[0])
    stamp, sent = (states.stamp_ns - first_stamp).astype(float), (states.publish_ns - first_sent).astype(float)
    rate = float(np.polyfit(stamp, sent, 1)[0])
    blocks = np.array_split(np.arange(len(stamp)), min(READING.clock_blocks, len(stamp)))
    prompt = [block[np.argmin((sent - rate * stamp)[block])] for block in blocks]
    rate = float(np.polyfit(stamp[prompt], sent[prompt], 1)[0])
    low, high = READING.player_rate_range
    if not low < rate < high:
        return commands.stamp_ns
    offset = float(np.quantile(sent - rate * stamp, READING.small_delay_quantile))
    played = (commands.publish_ns - first_sent).astype(float)
    converted: Times = first_stamp + np.rint((played - offset) / rate).astype(np.int64)
    return converted


def _named(data: TopicData, field: str, names: Sequence[str]) -> Array:
    """A field with a column for each name; NaN for names that the topic lacks."""
    values = data[field]
    if data.names == tuple(names):
        return np.asarray(values, np.float64)
    result = np.full((len(values), len(names)), np.nan)
    for column, name in enumerate(names):
        if name in data.names:
            result[:, column] = values[:, data.names.index(name)]
    return result


def _times(path: Path, topics: Mapping[str, TopicData], period_s: float | None, stamps_ns: Times | None) -> Times:
    """The times that were asked for, see Recording.on_time_base."""
    if stamps_ns is not None:
        times = np.asarray(stamps_ns, np.int64)
        if times.ndim != 1 or (np.diff(times) <= 0).any():
            raise RecordingError("stamps_ns must be rising times in one row")
        return times
    stamps = [topic.stamp_ns for name, topic in topics.items() if name != "clock" and len(topic)]
    if period_s is None:
        if "joint_states" not in topics:
            raise RecordingError(f"{path} has no joint_states: give a period or the times")
        return in_order(topics["joint_states"].stamp_ns)[0]
    if not (np.isfinite(period_s) and period_s > 0):
        raise RecordingError(f"period_s = {period_s} is not a finite number above 0")
    first, last = min(int(part.min()) for part in stamps), max(int(part.max()) for part in stamps)
    return first + np.round(np.arange(int((last - first) / (period_s * NS)) + 1) * (period_s * NS)).astype(np.int64)
