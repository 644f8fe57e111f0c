"""A recording next to models of the hand: what each makes of its set-points, and the mismatch as it happened. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.kernel.layout import PHI, P
from hand_recording.signals import Signals
from hand_studio.force import force_reading, has_force
from hand_studio.one_ahead import OneAhead
from hand_studio.window import Window, begin, read_angle, simulate, stamped

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
    angle, pressure, force, set_point = (*(np.full(shape, np.nan) for _ in range(3)), np.zeros(shape))
    columns = [hand.joints.index(joint) for joint in signals.joints]
    angle[:, columns], set_point[:, columns] = signals.angle_rad, signals.set_point_pa
    pressure[:, columns] = np.where(signals.has_pressure, signals.pressure_pa, np.nan)
    force[:, columns] = signals.force_n
    return Window(signals.period_s, angle, pressure, set_point, force)


@dataclass(frozen=True, slots=True)
class Run:
    """A model on a recording or a segment of it.

    parameters: (rows, joints) SI.  angle_rad, pressure_pa: (T, joints) as measured, the pressures by the clock of the
    plant.  states: (STATES, joints) at the start of each segment.
    """

    parameters: Array
    angle_rad: Array
    pressure_pa: Array
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
        loop, readings, states = begin(self.hand, parameters, self.window), [], []
        before = loop.state
        for segment in range(math.ceil(len(self.window.angle_rad) / self._length)):
            states.append(loop.state[0])
            later = np.concatenate([before, loop.advance(self.window.set_point_pa[None, self.cut(segment)])[0]])
            readings.append(later[:-1])
            before = later[-1:]
        made = np.concatenate(readings)
        return Run(parameters, read_angle(self.hand, made[:, PHI]), made[:, P], tuple(states))

    def what_if(self, run: Run, parameters: Array, segment: int) -> Run:
        """A segment by other parameters (rows, joints), SI, from the state of a run on."""
        state = run.states[segment]
        made = simulate(self.hand, parameters, self._part(segment), state)[1][:-1]
        return Run(parameters, read_angle(self.hand, made[:, PHI]), made[:, P], (state,))

    def segment_of(self, run: Run, segment: int) -> Run:
        """A segment of the run of a whole recording."""
        cut = self.cut(segment)
        return Run(run.parameters, run.angle_rad[cut], run.pressure_pa[cut], (run.states[segment],))

    def curves(self, segment: int, joint: int, runs: Sequence[Run]) -> list[list[Array]]:
        """Angles, pressures and, where there is a sensor, forces (T,), SI, of a joint: measured, and of each run.

        runs: of this segment.
        """
        part = self._part(segment)
        angles = [part.angle_rad[:, joint], *(run.angle_rad[:, joint] for run in runs)]
        pressures = [stamped(run.pressure_pa[:, joint], run.parameters, joint, part.period_s) for run in runs]
        curves = [angles, [part.pressure_pa[:, joint], *pressures]]
        if has_force(self.hand, joint) and part.force_n is not None and np.isfinite(part.force_n[:, joint]).any():
            forces = [force_reading(self.hand, run.parameters, part, joint, run.states[0]) for run in runs]
            curves.append([part.force_n[:, joint], *forces])
        return curves

    def _part(self, segment: int) -> Window:
        cut = self.cut(segment)
        return self.window.part(cut.start, cut.stop)

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
