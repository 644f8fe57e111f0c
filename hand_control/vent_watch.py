"""Whether a vented hand loses its pressure: a valve that stays open leaves its joint bent, whatever is commanded.

The expectation is that of `PressureWatch` for set-points of 0 Pa, from the pressure measured at first: the valve as
described, or twice as slow, and what the motion of the joint displaces. A pressure that stays above it for
NOT_FOLLOWING_S is reported. Nothing is left to vent, so that nothing is latched.
"""

from __future__ import annotations

import numpy as np

from hand_control.frame_checks import NOT_FOLLOWING_S, STUCK_HIGH, PressureWatch
from hand_control.sensor_lines import pressure_off
from hand_model.arrays import Array
from hand_model.description import Hand


class VentWatch:
    """Compares the pressures of a vented hand with 0 Pa. line: the joint whose pressure stays; empty for none."""

    def __init__(self, hand: Hand) -> None:
        """Begin at the next frame."""
        self._hand = hand
        self._pressures = PressureWatch(hand)
        self._zero = np.zeros(len(hand.joints))
        self._angle = np.zeros(len(hand.joints))
        self._begun = False
        self.line = ""

    def forget(self) -> None:
        """The hand is driven; when it is vented again, the expectation begins at what is measured then."""
        self._begun, self.line = False, ""

    def frame(self, position: Array, pressure: Array, dt: float) -> None:
        """Take a frame of the vented hand, dt [s] after the last one: angles (n,) [rad], pressures (n,) [Pa].

        A joint without a measured pressure is not watched, and one without an angle as if it stood still.
        """
        np.copyto(self._angle, position, where=np.isfinite(position))
        known = np.where(np.isfinite(pressure), pressure, 0.0)
        if not self._begun:
            self._pressures.start(known, self._angle)
            self._begun = True
        self._pressures.check(self._zero, known, dt, self._angle)
        joint = int(np.argmax(self._pressures.high_s))
        stays = self._pressures.high_s[joint] > NOT_FOLLOWING_S
        self.line = self._line(joint, float(pressure[joint])) if stays else ""

    def _line(self, joint: int, pressure_pa: float) -> str:
        hand = self._hand
        channel, limit_pa = int(hand.sensors.pressure_channel[joint]), float(hand.limits.max_pressure_pa[joint])
        return f"vented, but {pressure_off(STUCK_HIGH, hand.joints[joint], channel, pressure_pa, limit_pa)}"
