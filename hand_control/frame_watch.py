"""What every frame of the controller passes, in one call of compiled code: plausible values, pressures, sensors.

The tests are those of frame_checks and sensor_watch. A call from Python costs more than most of them, so that a frame
without a gap calls once for all three, and once for all limits of the set-points.
"""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from hand_control.declared import inlined
from hand_control.frame_checks import (
    DRIVEN,
    EXPECTED,
    FINE,
    FOLLOWING,
    WIDER,
    PressureWatch,
    allowed_jump,
    cap_pressures,
    implausible,
    watch_pressures,
)
from hand_control.frame_checks import ROWS as PRESSURE_ROWS
from hand_control.sensor_lines import Contradiction
from hand_control.sensor_watch import ELAPSED, SensorWatch, check_sensors, hold_sensors
from hand_control.sensor_watch import ROWS as SENSOR_ROWS
from hand_control.step_watch import FINE as UNSUSPICIOUS
from hand_model.arrays import Array
from hand_model.compile_cache import without_arrays
from hand_model.description import Hand


class Findings(NamedTuple):
    """Verdicts of a frame. plausible: of `implausible`, and its joint.  pressure: of `PressureWatch`, and its joint."""

    plausible: int
    implausible_joint: int
    pressure: int
    pressure_joint: int
    contradiction: Contradiction | None


_SENSORS = 1 + PRESSURE_ROWS
"""Row of the memory where the sensors begin, after the last position and the pressures: each array of a call costs."""
NOTHING = Findings(FINE, 0, FOLLOWING, 0, None)
"""Of a frame that passes."""


@inlined
def _note(found, verdicts):  # type: ignore[no-untyped-def]
    """Set the verdicts of a frame that does not pass; False."""
    for k in range(len(verdicts)):
        found[k] = verdicts[k]
    return False


@without_arrays
def _frame(  # type: ignore[no-untyped-def]
    found, memory, spacing, links, liquid, position, velocity, pressure, command, jump, dt
):
    """Whether a frame passes; else found is set: implausible, its joint, pressure, its joint, sensor, joint, other.

    A call that returns eight numbers to Python costs more than a test.
    """
    spacing[ELAPSED] = dt
    last, pressures, sensors = memory[0], memory[1:_SENSORS], memory[_SENSORS:]
    verdict, worst = implausible(position, velocity, pressure, last, allowed_jump(jump, dt))
    if verdict != FINE:
        return _note(found, (verdict, worst, FOLLOWING, 0, UNSUSPICIOUS, 0, -1))
    for i in range(len(position)):
        last[i] = position[i]
    high_low, joint = watch_pressures(pressures, command, pressure, position, dt)
    drive = pressures[DRIVEN] if liquid else pressure
    wrong, one, other = check_sensors(
        sensors, spacing, links, liquid, position, pressure, pressures[EXPECTED], pressures[WIDER], drive, dt
    )
    if high_low == FOLLOWING and wrong == UNSUSPICIOUS:
        return True
    return _note(found, (verdict, worst, high_low, joint, wrong, one, other))


@without_arrays
def _hold(memory, spacing, command):  # type: ignore[no-untyped-def]
    """Limit the set-points in place; whether a suspected sensor has lowered one."""
    cap_pressures(memory[1:_SENSORS], command, spacing[ELAPSED])
    return hold_sensors(memory[_SENSORS:], spacing, command)


class FrameWatch:
    """All tests of the frames of one hand.

    pressures, sensors: the watches with their states.  limits: whether `hold` has lowered a set-point for a suspected
    sensor, so that an integrator would run away.  last_position: (n,) [rad] of the last frame that counted; NaN: none.
    """

    def __init__(self, hand: Hand) -> None:
        """Begin without evidence; `start` gives the first measurement."""
        self._memory = np.zeros((_SENSORS + SENSOR_ROWS, len(hand.joints)))
        self.pressures = PressureWatch(hand, self._memory[1:_SENSORS])
        self.sensors = SensorWatch(hand, self._memory[_SENSORS:])
        self.last_position: Array = self._memory[0]
        self.last_position.fill(math.nan)
        self.limits = False
        self._found = np.zeros(7, dtype=np.int64)
        self._longest_s = min(self.sensors.gap_s, self.pressures.gap_s)
        self._judge = partial(_frame, self._found, self._memory, *self.sensors.arrays[1:])
        self._limit = partial(_hold, self._memory, self.sensors.arrays[1])

    def start(self, position: Array, velocity: Array, pressure: Array) -> None:
        """Begin without evidence at position (n,) [rad], velocity (n,) [rad/s] and pressure (n,) [Pa]."""
        self.last_position[:] = position
        self.pressures.start(pressure, position)
        self.sensors.start(position, velocity, pressure)

    def plausible(
        self, position: Array, velocity: Array, pressure: Array, max_jump_rad: float, elapsed_s: float
    ) -> tuple[int, int]:
        """Verdict of `implausible` and its joint, of a frame elapsed_s [s] after the last one; nothing is kept."""
        jump = allowed_jump(max_jump_rad, elapsed_s)
        return implausible(position, velocity, pressure, self.last_position, jump)  # type: ignore[no-any-return]

    def check(
        self, measured: tuple[Array, Array, Array], command: Array, max_jump_rad: float, elapsed_s: float
    ) -> Findings:
        """What a frame shows, elapsed_s [s] after the last one that counted.

        measured: position [rad], velocity [rad/s], pressure [Pa], (n,) each.  command: (n,) [Pa], in force until now.
        max_jump_rad: largest plausible change of an angle within JUMP_S.
        """
        if not 0.0 < elapsed_s <= self._longest_s:
            return self._after_gap(measured, command, max_jump_rad, elapsed_s)
        position, velocity, pressure = measured
        if self._judge(position, velocity, pressure, command, max_jump_rad, elapsed_s):
            return NOTHING
        verdict, worst, high_low, joint, *contradiction = self._found.tolist()
        return Findings(verdict, worst, high_low, joint, self.sensors.contradiction(*contradiction))

    def _after_gap(
        self, measured: tuple[Array, Array, Array], command: Array, max_jump_rad: float, elapsed_s: float
    ) -> Findings:
        """The same, test by test: each has a rule of its own for the time without frames."""
        position, _, pressure = measured
        verdict, worst = self.plausible(*measured, max_jump_rad, elapsed_s)
        if verdict != FINE:
            return Findings(verdict, worst, FOLLOWING, 0, None)
        self.last_position[:] = position
        followed = self.pressures.check(command, pressure, elapsed_s, position)
        watch = self.pressures
        found = self.sensors.check(position, pressure, watch.expected, watch.driven, elapsed_s, watch.wider)
        return Findings(verdict, worst, *followed, found)

    def hold(self, command: Array) -> None:
        """Limit set-points (n,) [Pa] in place to what the pressures justify, and the sensors that are believed."""
        self.limits = self._limit(command)
