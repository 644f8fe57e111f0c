"""Frames of a running hand with the set-points in force, complete and in order. Pure: stamps are arguments."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from hand_model.arrays import Array

KEPT = 400
"""Newest frames and commands that wait to be taken."""


@dataclass(frozen=True, slots=True)
class Sample:
    """A frame: stamp_ns [ns], angle_rad and pressure_pa (joints,) as measured, set_point_pa (joints,) from it on.

    force_n: (joints,) of the sensor on each joint; NaN where there is none, or its message did not come.
    """

    stamp_ns: int
    angle_rad: Array
    pressure_pa: Array
    set_point_pa: Array
    force_n: Array

    def lost(self, set_point_pa: Array) -> Sample:
        """A frame in place of this one that was lost; the set-points (joints,) [Pa] stay in force."""
        unknown = np.full(len(set_point_pa), np.nan)
        return Sample(self.stamp_ns, unknown, unknown, set_point_pa, unknown)


@dataclass
class Samples:
    """Collects the messages of joint_states, pressures, contact_forces and valve_command of some joints.

    site_joint: index of the joint that carries a force site, by the name of the site.
    """

    joints: tuple[str, ...]
    site_joint: Mapping[str, int] = field(default_factory=dict)
    _angles: deque[tuple[int, Array]] = field(default_factory=lambda: deque(maxlen=KEPT))
    _pressures: dict[int, Array] = field(default_factory=dict)
    _forces: dict[int, Array] = field(default_factory=dict)
    _commands: deque[tuple[int, int, Array]] = field(default_factory=lambda: deque(maxlen=KEPT))

    def angles(self, stamp_ns: int, names: Sequence[str], position_rad: Sequence[float]) -> None:
        """Take a message of joint_states: stamp [ns], angles [rad]."""
        self._angles.append((stamp_ns, self._ordered(names, position_rad)))

    def pressures(self, stamp_ns: int, names: Sequence[str], pressure_pa: Sequence[float]) -> None:
        """Take a message of pressures: stamp [ns], values [Pa]."""
        _keep(self._pressures, stamp_ns, self._ordered(names, pressure_pa))

    def forces(self, stamp_ns: int, names: Sequence[str], force_n: Sequence[float]) -> None:
        """Take a message of contact_forces: stamp [ns], values [N] by the names of their sites."""
        values = np.full(len(self.joints), np.nan)
        for name, force in zip(names, force_n, strict=False):
            if self.site_joint.get(name, -1) >= 0:
                values[self.site_joint[name]] = force
        _keep(self._forces, stamp_ns, values)

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
            force = self._forces.pop(stamp_ns, np.full(len(self.joints), np.nan))
            if pressure is not None:
                taken.append(Sample(stamp_ns, angle, pressure, self._in_force(stamp_ns), force))
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


def _keep(messages: dict[int, Array], stamp_ns: int, values: Array) -> None:
    """Keep the newest messages by their stamps."""
    messages[stamp_ns] = values
    if len(messages) > KEPT:
        del messages[next(iter(messages))]
