"""The model next to a running hand: one sample ahead for the mismatch, and on its own for the ghost and the curves."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hand_client.samples import Sample
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.kernel.closed_loop import ClosedLoop
from hand_model.kernel.layout import PHI
from hand_studio.one_ahead import OneAhead
from hand_studio.window import Window, begin, read_angle, simulate

SHOWN_S = 10.0
"""Length of the curves."""
START_S, REST_RAD = 0.3, 0.01
"""The model starts after a time in which no joint moved further: only of a hand at rest, the creep is known."""
LONGEST_GAP = 20
"""Frames that may be missing; after a longer gap the model starts again."""


class LiveModel:
    """Takes samples in order. The ghost starts in the measured state and then follows the set-points alone."""

    def __init__(self, hand: Hand) -> None:
        """Begin with the parameters of the hand's description."""
        self._hand, self._parameters = hand, hand.parameters.copy()
        self._period_s = 1.0 / hand.rate_hz
        self._samples: list[Sample] = []
        self._states: list[Array] = []
        self._ghost_rad: list[Array] = []
        self._ghost: ClosedLoop | None = None
        self._ahead: OneAhead | None = None

    @property
    def mismatch(self) -> Array:
        """Mean difference from the one-sample prediction (joints,), in standard deviations; 0 before the start [-]."""
        return np.zeros(len(self._hand.joints)) if self._ahead is None else self._ahead.mismatch

    @property
    def ghost_rad(self) -> Array | None:
        """Newest angles (joints,) [rad] of the ghost; None before the start."""
        return self._ghost_rad[-1] if self._ghost_rad else None

    def curves(self, joint: int) -> tuple[Array, Array, Array]:
        """Time (T,) [s] up to now, measured angle and that of the ghost (T,) [rad] of a joint."""
        count = len(self._ghost_rad)
        measured = np.array([sample.angle_rad[joint] for sample in self._samples[:count]])
        ghost = np.array([angle[joint] for angle in self._ghost_rad])
        time_s = self._period_s * np.arange(1.0 - count, 1.0)
        return time_s, measured, ghost

    def change(self, parameters: Array) -> None:
        """Give the ghost other parameters (rows, joints), SI, also for the time that the curves show."""
        self._parameters = parameters.copy()
        self.restart()

    def restart(self) -> None:
        """Start the ghost again in the state that was measured where the curves begin."""
        if self._ahead is None:
            return
        self._ghost, angles = simulate(self._hand, self._parameters, self._window(), self._states[0])
        self._ghost_rad = list(angles)

    def add(self, samples: Sequence[Sample]) -> None:
        """Take the frames that follow."""
        for sample in samples:
            ticks = self._ticks_to(sample)
            if ticks > LONGEST_GAP:
                self._samples, self._states, self._ghost_rad, self._ghost, self._ahead = [], [], [], None, None
            for _ in range(ticks - 1 if self._samples else 0):  # lost frames: the set-points stay in force
                self._take(Sample(sample.stamp_ns, *_unknown(sample), self._samples[-1].set_point_pa))
            self._take(sample)

    def _ticks_to(self, sample: Sample) -> int:
        if not self._samples:
            return 1
        return max(round((sample.stamp_ns - self._samples[-1].stamp_ns) * 1e-9 / self._period_s), 1)

    def _take(self, sample: Sample) -> None:
        self._samples.append(sample)
        if self._ghost is None or self._ahead is None:
            self._start()
            return
        self._states.append(self._ahead.state)
        self._ahead.step(sample.angle_rad, sample.pressure_pa, sample.set_point_pa)
        self._ghost_rad.append(read_angle(self._hand, self._ghost.state[0, PHI]))
        self._ghost.advance(sample.set_point_pa[None, None])
        if len(self._samples) > SHOWN_S / self._period_s:
            del self._samples[0], self._states[0], self._ghost_rad[0]

    def _start(self) -> None:
        """Start where the newest samples are those of a hand at rest."""
        if len(self._samples) < math.ceil(START_S / self._period_s):
            return
        window = self._window()
        known = np.isfinite(window.angle_rad)
        highest, lowest = (np.where(known, window.angle_rad, bound) for bound in (-np.inf, np.inf))
        if not np.all(highest.max(axis=0) - lowest.min(axis=0) < REST_RAD):
            del self._samples[0]
            return
        self._ahead = OneAhead(self._hand, self._hand.parameters, window)
        self._states = [begin(self._hand, self._hand.parameters, window).state[0]] * len(self._samples)
        self.restart()

    def _window(self) -> Window:
        fields = ("angle_rad", "pressure_pa", "set_point_pa")
        return Window(self._period_s, *(np.array([getattr(s, name) for s in self._samples]) for name in fields))


def _unknown(sample: Sample) -> tuple[Array, Array]:
    return np.full_like(sample.angle_rad, np.nan), np.full_like(sample.pressure_pa, np.nan)
