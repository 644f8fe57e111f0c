"""Zero of the pressure sensors: their reading while the hand is vented is atmospheric pressure."""

from __future__ import annotations

import numpy as np

from hand_driver.board import Frame, Status
from hand_model.arrays import Array
from hand_model.description import Hand

SETTLE_FRAMES = 200
"""Number of frames, after the board reports VENTED, in which the last pressure escapes."""
AVERAGE_FRAMES = 100
MAX_OFFSET_PA = 5e4
"""A larger offset is not a drift of the sensor: pressure remains in the actuator, or the sensor is broken."""


class PressureZero:
    """Averages the pressure channels while the board reports VENTED."""

    def __init__(self, hand: Hand) -> None:
        """Begin with no frames."""
        self._hand = hand
        self._vented = 0
        self._sum = np.zeros(len(hand.joints))
        self._count = 0

    def frame(self, frame: Frame) -> None:
        """Add one frame; a frame that is not vented restarts the average."""
        if Status.VENTED not in frame.status:
            self._vented = self._count = 0
            self._sum[:] = 0.0
            return
        self._vented += 1
        if self._vented > SETTLE_FRAMES:
            sensors = self._hand.sensors
            volts = sensors.adc.voltage_v(frame.counts[sensors.pressure_channel])
            self._sum += volts / max(frame.supply_voltage_v, 1e-3)
            self._count += 1

    def result(self) -> tuple[Array, str]:
        """New ratio at zero pressure (joints,) and a line about it. ValueError: not determined yet, or implausible."""
        if self._count < AVERAGE_FRAMES:
            missing = SETTLE_FRAMES + AVERAGE_FRAMES - self._vented
            raise ValueError(f"the hand must be vented for another {missing} frames; vent it and try again")
        ratio: Array = self._sum / self._count
        offset_pa = self._hand.sensors.pressure.pressure_pa(ratio)
        worst = int(np.argmax(np.abs(offset_pa)))
        if abs(offset_pa[worst]) > MAX_OFFSET_PA:
            raise ValueError(
                f"{self._hand.joints[worst]} reads {offset_pa[worst]:.0f} Pa while vented; "
                f"at most {MAX_OFFSET_PA:g} Pa is taken as an offset"
            )
        return ratio, f"pressure zero taken; largest offset {offset_pa[worst]:.0f} Pa at {self._hand.joints[worst]}"
