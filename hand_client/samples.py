"""Frames of a running hand with the set-points in force, complete and in order. Pure: stamps are arguments."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from hand_model.arrays import Array

KEPT = 400
"""Newest frames and commands that wait to be taken."""


@dataclass(frozen=True, slots=True)
class Sample:
    """A frame: stamp_ns [ns], angle_rad and pressure_pa (joints,) as measured, set_point_pa (joints,) from it on."""

    stamp_ns: int
    angle_rad: Array
    pressure_pa: Array
    set_point_pa: Array


@dataclass
class Samples:
    """Collects the messages of joint_states, pressures and valve_command of some joints."""

    joints: tuple[str, ...]
    _angles: deque[tuple[int, Array]] = field(default_factory=lambda: deque(maxlen=KEPT))
    _pressures: dict[int, Array] = field(default_factory=dict)
    _commands: deque[tuple[int, int, Array]] = field(default_factory=lambda: deque(maxlen=KEPT))

    def angles(self, stamp_ns: int, names: Sequence[str], position_rad: Sequence[float]) -> None:
        """Take a message of joint_states: stamp [ns], angles [rad]."""
        self._angles.append((stamp_ns, self._ordered(names, position_rad)))

    def pressures(self, stamp_ns: int, names: Sequence[str], pressure_pa: Sequence[float]) -> None:
        """Take a message of pressures: stamp [ns], values [Pa]."""
        self._pressures[stamp_ns] = self._ordered(names, pressure_pa)
        if len(self._pressures) > KEPT:
            del self._pressures[next(iter(self._pressures))]

    def command(self, stamp_ns: int, lifetime_ns: int, names: Sequence[str], pressure_pa: Sequence[float]) -> None:
        """Take a message of valve_command: stamp of the frame that it answers [ns], lifetime [ns], set-points [Pa]."""
        self._commands.append((stamp_ns, lifetime_ns, self._ordered(names, pressure_pa)))

    def take(self, until_ns: int) -> list[Sample]:
        """All frames up to a stamp [ns], which must be so old that everything that belongs to them has come.

        A frame's command is sent just after the frame and acts from the next one on, until its lifetime ends. Frames
        whose pressures were lost are left out.
        """
        taken = []
        while self._angles and self._angles[0][0] <= until_ns:
            stamp_ns, angle = self._angles.popleft()
            pressure = self._pressures.pop(stamp_ns, None)
            if pressure is not None:
                taken.append(Sample(stamp_ns, angle, pressure, self._in_force(stamp_ns)))
        return taken

    def _in_force(self, stamp_ns: int) -> Array:
        while len(self._commands) > 1 and self._commands[1][0] < stamp_ns:
            self._commands.popleft()
        if self._commands and self._commands[0][0] < stamp_ns <= self._commands[0][0] + self._commands[0][1]:
            return self._commands[0][2]
        return np.zeros(len(self.joints))

    def _ordered(self, names: Sequence[str], values: Sequence[float]) -> Array:
        if tuple(names) == self.joints:
            return np.asarray(values, dtype=np.float64)
        known = dict(zip(names, values, strict=False))
        return np.array([known.get(joint, np.nan) for joint in self.joints])
