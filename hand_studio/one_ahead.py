"""The plant next to the measured hand, one sample ahead: how far the model is off, against the noise, as it happens.

After every sample the state is corrected by the difference between measurement and prediction with the gains of an
alpha-beta filter (Kalata, IEEE Trans. Aerospace and Electronic Systems 20(2), 1984), so that the next prediction starts
from the measured state. What a correct model leaves is white noise; its mean over a while shows what the model lacks.
"""

from __future__ import annotations

import numpy as np

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.kernel.layout import OMEGA, PHI, P
from hand_model.kernel.rows import STATES
from hand_studio.window import Window, begin, read_angle

ALPHA, PRESSURE_GAIN = 0.3, 0.5
BETA = ALPHA * ALPHA / (2.0 - ALPHA)
MEAN_S = 0.15
"""Time over which the difference is averaged: motions to and fro must not cancel what opposes them."""
NOISE_S = 2.0
"""Time over which the noise is estimated, from differences of successive samples, which motion hardly changes."""
SETTLE_S = 0.5
"""Time after a start in which nothing is reported."""


class OneAhead:
    """Predicts each sample from those before it; `mismatch` is the mean difference in its standard deviations."""

    def __init__(self, hand: Hand, parameters: Array, window: Window) -> None:
        """Begin at the end of a window of a fraction of a second. parameters: (rows, joints) SI."""
        joints, self._hand, self._period_s = len(hand.joints), hand, window.period_s
        self._loop = begin(hand, parameters, window)
        self._loop.advance(window.set_point_pa[None])
        self._gain, self._slow = window.period_s / MEAN_S, window.period_s / NOISE_S
        self._samples = 0
        self._mean, self._before, self._noise2 = np.zeros(joints), np.full(joints, np.nan), np.zeros(joints)

    def step(self, angle_rad: Array, pressure_pa: Array, set_point_pa: Array) -> Array:
        """Take the sample that follows: measured angle, pressure and the set-point from it on, each (joints,).

        Returns the difference of measured and predicted angle (joints,) [rad].
        """
        state = self.state
        error = angle_rad - read_angle(self._hand, state[PHI])
        off = pressure_pa - state[P]
        known = np.isfinite(error) & np.isfinite(off)
        error, off = np.where(known, error, 0.0), np.where(known, off, 0.0)
        change = np.zeros((STATES, len(error)))
        change[PHI], change[OMEGA] = ALPHA * error, BETA / self._period_s * error
        change[P] = PRESSURE_GAIN * off
        self._loop.shift(change[None])
        self._loop.advance(set_point_pa[None, None])
        self._learn(error)
        return error

    def _learn(self, error: Array) -> None:
        self._samples += 1
        self._mean += self._gain * (error - self._mean)
        if np.isfinite(self._before).all():
            share = max(self._slow, 1.0 / self._samples)
            self._noise2 += share * (0.5 * (error - self._before) ** 2 - self._noise2)
        self._before = error

    @property
    def state(self) -> Array:
        """Estimated state at the next sample (STATES, joints), SI."""
        state: Array = self._loop.state[0]
        return state

    @property
    def mismatch(self) -> Array:
        """Mean difference (joints,) in standard deviations that white noise alone would give it [-]."""
        if self._samples * self._period_s < SETTLE_S:
            return np.zeros_like(self._mean)
        deviation = np.sqrt(self._noise2 * self._gain / (2.0 - self._gain))
        return np.asarray(self._mean / np.maximum(deviation, 1e-9))

    @property
    def noise_rad(self) -> Array:
        """Standard deviation of the white part of the differences (joints,) [rad]."""
        return np.asarray(np.sqrt(self._noise2))
