"""The model next to a running hand: one sample ahead for the mismatch, and on its own for the ghost and the curves."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hand_client.samples import Sample
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.kernel.closed_loop import ClosedLoop
from hand_model.kernel.layout import PHI, P
from hand_model.kernel.rows import STATES
from hand_studio.force import force_reading, has_force
from hand_studio.one_ahead import OneAhead
from hand_studio.window import Window, begin, read_angle, simulate, stamped

SHOWN_S = 10.0
"""Length of the curves."""
START_S, REST_RAD = 0.3, 0.01
"""The model starts after a time in which no joint moved further: only of a hand at rest, the creep is known."""
FORCE_S = 0.5
"""Period in which the force of the model is computed, which takes longer than the other curves."""
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
        self._readings: list[Array] = []
        self._changes, self._force_of = 0, (-1, 0)
        self._force_n, self._force_ns = np.zeros(0), 0
        self._ghost: ClosedLoop | None = None
        self._ahead: OneAhead | None = None

    @property
    def mismatch(self) -> Array:
        """Mean difference from the one-sample prediction (joints,), in standard deviations; 0 before the start [-]."""
        return np.zeros(len(self._hand.joints)) if self._ahead is None else self._ahead.mismatch

    @property
    def ghost_rad(self) -> Array | None:
        """Newest angles (joints,) [rad] of the ghost; None before the start."""
        return read_angle(self._hand, self._readings[-1][PHI]) if self._readings else None

    def curves(self, joint: int, *, with_force: bool = True) -> tuple[Array, list[list[Array]]]:
        """Time (T,) [s] up to now, and signals of a joint, each measured and of the ghost, (T,), SI.

        The signals are angle, pressure and, where the joint has a sensor and forces come, the force.
        """
        count = len(self._readings)
        made = np.array([reading[:, joint] for reading in self._readings]).reshape(count, STATES)
        angle = np.zeros((count, len(self._hand.joints)))
        angle[:, joint] = made[:, PHI]
        curves = [
            [self._measured("angle_rad", joint, count), read_angle(self._hand, angle)[:, joint]],
            [
                self._measured("pressure_pa", joint, count),
                stamped(made[:, P], self._parameters, joint, self._period_s),
            ],
        ]
        if with_force and count and has_force(self._hand, joint):
            measured_n = self._measured("force_n", joint, count)
            if np.isfinite(measured_n).any():
                curves.append([measured_n, self._force(joint, count)])
        return self._period_s * np.arange(1.0 - count, 1.0), curves

    def _measured(self, name: str, joint: int, count: int) -> Array:
        return np.array([getattr(sample, name)[joint] for sample in self._samples[:count]], dtype=np.float64)

    def _force(self, joint: int, count: int) -> Array:
        """Force (T,) [N] of the model; NaN at the newest samples, because it is computed every FORCE_S only."""
        newest_ns, chosen = self._samples[count - 1].stamp_ns, (joint, self._changes)
        late = round((newest_ns - self._force_ns) * 1e-9 / self._period_s)
        if chosen != self._force_of or not 0 <= late < FORCE_S / self._period_s:
            self._force_n = force_reading(self._hand, self._parameters, self._window(count), joint, self._states[0])
            self._force_ns, self._force_of, late = newest_ns, chosen, 0
        known = self._force_n[max(len(self._force_n) + late - count, 0) :]
        return np.concatenate([known, np.full(count - len(known), np.nan)])

    def change(self, parameters: Array) -> None:
        """Give the ghost other parameters (rows, joints), SI, also for the time that the curves show."""
        self._parameters = parameters.copy()
        self.restart()

    def restart(self) -> None:
        """Start the ghost again in the state that was measured where the curves begin."""
        if self._ahead is None:
            return
        self._ghost, readings = simulate(self._hand, self._parameters, self._window(), self._states[0])
        self._readings, self._next = list(readings[:-1]), readings[-1]
        self._changes += 1

    def add(self, samples: Sequence[Sample]) -> None:
        """Take the frames that follow."""
        for sample in samples:
            ticks = self._ticks_to(sample)
            if ticks > LONGEST_GAP:
                self._samples, self._states, self._readings, self._ghost, self._ahead = [], [], [], None, None
            for _ in range(ticks - 1 if self._samples else 0):  # lost frames: the set-points stay in force
                self._take(sample.lost(self._samples[-1].set_point_pa))
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
        self._readings.append(self._next)
        self._next = self._ghost.advance(sample.set_point_pa[None, None])[0, 0]
        if len(self._samples) > SHOWN_S / self._period_s:
            del self._samples[0], self._states[0], self._readings[0]

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

    def _window(self, count: int | None = None) -> Window:
        """The samples, or the first `count` of them."""
        samples = self._samples[:count]
        fields = ("angle_rad", "pressure_pa", "set_point_pa", "force_n")
        shape = (len(samples), len(self._hand.joints))
        return Window(
            self._period_s, *(np.array([getattr(sample, name) for sample in samples]).reshape(shape) for name in fields)
        )
