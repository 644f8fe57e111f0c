"""Channels that no longer measure: counts that stay bit-identical for longer than their own noise allows.

    what                                                          then not believed
    a channel repeats its count longer than chance allows         this channel
    every watched channel repeats at once, the same rule          all channels: the converter sends old frames
    a channel with noise has not changed at all for DEAD_S        this channel

Chance: while a channel changes, its share of repeated counts is learned over blocks of BLOCK frames; the largest share
counts, forgotten slowly, and never less than FLOOR. With a share q, a run of n repeats has a probability of q^n, so
that n = ln(a) / ln(q) gives at most FALSE_ALARMS_PER_HOUR for all channels together, a being that rate per frame and
channel. A channel whose neighbouring samples are correlated repeats more often, and q contains it.

A channel is watched where the description says that it has noise of more than QUIET counts: a simulated hand without
noise, or a sensor that is described as quieter than the converter resolves, repeats its counts rightly. A force channel
at 0 counts is an open film and not stuck. A channel is believed again once it has changed as usual for BELIEVED_S.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hand_driver.board import Counts
from hand_driver.measurement import channel_names
from hand_model.arrays import Flags
from hand_model.compile_cache import njit
from hand_model.description import Hand

FALSE_ALARMS_PER_HOUR = 1e-6
"""Upper bound for all channels of a hand, where the repeats of a channel are as likely as learned."""
FLOOR = 0.1
"""Least probability of a repeat: a share learned from few frames may be too low by chance."""
QUIET = 0.3
"""[counts] Channels whose described noise is below this are not watched."""
BLOCK = 512
"""Frames over which a share of repeats is counted."""
KEPT = 0.997
"""Share of a learned probability that is kept after each block: at 200 Hz its half-life is ten minutes."""
DEAD_S, BELIEVED_S = 2.0, 1.0
LONGEST_S = 60.0
"""A channel that would need a longer run is too quiet to be watched."""
FEWEST_FRAMES = 3
"""Repeats of a whole frame that are tolerated, however unlikely: a converter may be read twice."""
_LAST, _RUN, _LIMIT, _REPEATS, _GOOD, _STUCK, _WATCHED, _ZERO = range(8)
_FRAME_RUN, _FRAME_LIMIT, _FRAME_GOOD, _FRAME_STUCK, _IN_BLOCK, _FRAME_REPEATS, _FRAMES = range(7)
_NEVER = 1 << 60
_SPOILED = -(1 << 40)
"""Repeats of a block that a fault has spoiled: nothing is learned from it."""


@njit(cache=True)
def _count(counts, channel, whole, believed_frames):  # type: ignore[no-untyped-def]
    """Count repeats in channel (8, channels) and whole (7,) in place; returns the number of channels not believed."""
    stuck, same, watched = 0, 0, 0
    first = whole[_FRAMES] == 0
    for c in range(len(counts)):
        value = np.int64(counts[c])
        open_film = channel[_ZERO, c] != 0 and value == 0
        repeat = not first and value == channel[_LAST, c]
        channel[_LAST, c] = value
        if channel[_WATCHED, c] == 0:
            continue
        if not open_film:
            watched += 1
            same += repeat
        channel[_RUN, c] = channel[_RUN, c] + 1 if repeat and not open_film else 0
        channel[_REPEATS, c] += repeat
        channel[_GOOD, c] = channel[_GOOD, c] + 1 if 2 * channel[_RUN, c] < channel[_LIMIT, c] else 0
        if channel[_RUN, c] >= channel[_LIMIT, c]:
            channel[_STUCK, c] = 1
        elif channel[_GOOD, c] >= believed_frames:
            channel[_STUCK, c] = 0
        if channel[_STUCK, c] != 0 or whole[_FRAME_STUCK] != 0:
            channel[_REPEATS, c] = _SPOILED
        stuck += channel[_STUCK, c]
    repeated = watched > 1 and same == watched
    whole[_FRAMES] += 1
    whole[_IN_BLOCK] += 1
    whole[_FRAME_REPEATS] += repeated
    whole[_FRAME_RUN] = whole[_FRAME_RUN] + 1 if repeated else 0
    whole[_FRAME_GOOD] = 0 if repeated else whole[_FRAME_GOOD] + 1
    if whole[_FRAME_RUN] >= whole[_FRAME_LIMIT]:
        whole[_FRAME_STUCK] = 1
    elif whole[_FRAME_GOOD] >= believed_frames:
        whole[_FRAME_STUCK] = 0
    return stuck + whole[_FRAME_STUCK]


class ChannelWatch:
    """Watches the counts of one connection, frame by frame."""

    def __init__(self, hand: Hand) -> None:
        """Begin without knowledge: until a first block, only a channel that never changes is found."""
        sensors, count = hand.sensors, hand.channel_count
        self._names = channel_names(hand)
        self._rate_hz = hand.rate_hz
        noise_v = np.zeros(count)
        for channels, sensor in (
            (sensors.angle_channel, sensors.hall),
            (sensors.pressure_channel, sensors.pressure),
            (sensors.force_channel, sensors.force),
        ):
            noise_v[channels] = sensor.noise_v
        self._channel: NDArray[np.int64] = np.zeros((8, count), dtype=np.int64)
        self._channel[_WATCHED] = noise_v * sensors.adc.full_scale / sensors.adc.reference_v > QUIET
        self._channel[_ZERO, sensors.force_channel] = 1
        self._channel[_LIMIT] = math.ceil(DEAD_S * self._rate_hz)
        self._whole: NDArray[np.int64] = np.zeros(7, dtype=np.int64)
        self._whole[_FRAME_LIMIT] = math.ceil(DEAD_S * self._rate_hz)
        self._chance = np.full(count, np.nan)
        self._believed_frames = math.ceil(BELIEVED_S * self._rate_hz)
        self._least = FALSE_ALARMS_PER_HOUR / (3600.0 * self._rate_hz * (count + 1))
        self.repeated_share = 0.0
        """Share of whole frames that were repeats, over the last block."""

    def check(self, counts: Counts) -> Flags | None:
        """Which channels (channels,) are not believed after a frame; None where all are."""
        found = _count(counts, self._channel, self._whole, self._believed_frames)
        if self._whole[_IN_BLOCK] >= BLOCK:
            self._learn()
        if not found:
            return None
        faulty: Flags = np.full(len(counts), True) if self._whole[_FRAME_STUCK] else self._channel[_STUCK] != 0
        return faulty

    @property
    def common_fault(self) -> str:
        """The fault of all channels together, with its evidence and what to check; empty where there is none."""
        if not self._whole[_FRAME_STUCK]:
            return ""
        return (
            f"every channel: the converter repeated the same frame {self._whole[_FRAME_RUN]} times in a row;"
            " check the converter, its clock and its supply"
        )

    @property
    def lines(self) -> tuple[str, ...]:
        """One line for each fault: the channel, the evidence and what to check."""
        if self.common_fault:
            return (self.common_fault,)
        return tuple(
            f"{self._names[c]} (channel {c}): {self._channel[_RUN, c]} equal readings of {self._channel[_LAST, c]}"
            f" counts in a row, {self._channel[_LIMIT, c]} are beyond chance; check the sensor, its cable and the"
            " converter's input"
            for c in np.flatnonzero(self._channel[_STUCK]).tolist()
        )

    @property
    def unwatched(self) -> tuple[str, ...]:
        """Channels on which a stuck reading would not be seen: they are described, or have turned out, as quiet."""
        quiet = (self._channel[_WATCHED] == 0) | (self._channel[_LIMIT] == _NEVER)
        return tuple(self._names[c] for c in np.flatnonzero(quiet).tolist() if c in self._names)

    def _learn(self) -> None:
        """End a block: the repeats of the channels that were believed set the runs that chance allows."""
        believed = self._channel[_REPEATS] >= 0
        share = np.clip(self._channel[_REPEATS] / BLOCK, FLOOR, 1.0)
        known = np.where(np.isnan(self._chance), share, np.maximum(share, KEPT * self._chance))
        self._chance = np.where(believed, known, self._chance)
        self.repeated_share = self._whole[_FRAME_REPEATS] / BLOCK
        self._channel[_REPEATS] = 0
        self._whole[[_IN_BLOCK, _FRAME_REPEATS]] = 0
        for c, q in enumerate(self._chance.tolist()):
            if not math.isnan(q):
                self._channel[_LIMIT, c] = self._run(math.log(q))
        watched = (self._channel[_WATCHED] != 0) & (self._channel[_ZERO] == 0)
        if watched.any() and not np.isnan(self._chance[watched]).any():
            run = self._run(float(np.log(self._chance[watched]).sum()))
            self._whole[_FRAME_LIMIT] = max(FEWEST_FRAMES, run)

    def _run(self, log_chance: float) -> int:
        """Repeats in a row that are beyond chance, where one has the logarithm of its probability."""
        if log_chance > -1e-9:
            return _NEVER
        run = math.ceil(math.log(self._least) / log_chance)
        return run if run <= LONGEST_S * self._rate_hz else _NEVER
