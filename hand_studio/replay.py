"""A recording next to models of the hand: what each makes of its set-points, and the mismatch as it happened. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.kernel.layout import PHI
from hand_recording.signals import Signals
from hand_studio.one_ahead import OneAhead
from hand_studio.window import Window, begin, read_angle, simulate

SEGMENT_S = 20.0
"""Length of the stretches that the curves show and that a slider computes again."""
START_S = 0.3
"""Beginning of a recording from which the state is estimated for the prediction of single samples."""


def window_of(signals: Signals, hand: Hand) -> Window:
    """The signals of a recording in the order of the hand; NaN for joints that were not recorded.

    Set-points between two samples are left out. Raises ValueError, one line, where no set-points were recorded.
    """
    if not signals.has_set_point.any():
        raise ValueError(f"{signals.name} has no valve_command; without set-points no model can run next to the hand")
    shape = (signals.samples, len(hand.joints))
    angle, pressure, set_point = np.full(shape, np.nan), np.full(shape, np.nan), np.zeros(shape)
    columns = [hand.joints.index(joint) for joint in signals.joints]
    angle[:, columns], set_point[:, columns] = signals.angle_rad, signals.set_point_pa
    pressure[:, columns] = np.where(signals.has_pressure, signals.pressure_pa, np.nan)
    return Window(signals.period_s, angle, pressure, set_point)


@dataclass(frozen=True, slots=True)
class Run:
    """A model on a whole recording: angles (T, joints) [rad] as measured, and states at the starts of the segments."""

    parameters: Array
    angle_rad: Array
    states: tuple[Array, ...]


class Replay:
    """A recording in segments of SEGMENT_S, the last of which may be shorter."""

    def __init__(self, hand: Hand, window: Window) -> None:
        """A recording of a hand."""
        self.hand, self.window = hand, window
        self._length = max(2, round(SEGMENT_S / window.period_s))

    @property
    def duration_s(self) -> float:
        """From the first sample to the last [s]."""
        return float(self.window.time_s[-1])

    def segment(self, sample: int) -> int:
        """Number of the segment that has a sample."""
        return sample // self._length

    def cut(self, segment: int) -> slice:
        """The samples of a segment."""
        return slice(segment * self._length, (segment + 1) * self._length)

    def run(self, parameters: Array) -> Run:
        """A model with parameters (rows, joints), SI, from the measured state at the start of the recording on."""
        loop, angles, states = begin(self.hand, parameters, self.window), [], []
        for segment in range(math.ceil(len(self.window.angle_rad) / self._length)):
            start = loop.state
            states.append(start[0])
            later = loop.advance(self.window.set_point_pa[None, self.cut(segment)])[0, :, PHI]
            angles.append(read_angle(self.hand, np.concatenate([start[:, PHI], later[:-1]])))
        return Run(parameters, np.concatenate(angles), tuple(states))

    def what_if(self, run: Run, parameters: Array, segment: int) -> Array:
        """Angles (T, joints) [rad] of a segment by other parameters (rows, joints), SI, from the state of a run on."""
        cut = self.cut(segment)
        window = self.window.part(cut.start, cut.stop)
        return simulate(self.hand, parameters, window, run.states[segment])[1]

    def mismatch(self, parameters: Array) -> Array:
        """Difference from the prediction of each sample (T, joints), in standard deviations of its noise [-]."""
        first = max(2, round(START_S / self.window.period_s))
        ahead = OneAhead(self.hand, parameters, self.window.part(0, first))
        values = np.zeros(self.window.angle_rad.shape)
        signals = (self.window.angle_rad, self.window.pressure_pa, self.window.set_point_pa)
        for sample, row in enumerate(zip(*(signal[first:] for signal in signals), strict=True), first):
            ahead.step(*row)
            values[sample] = ahead.mismatch
        return values
