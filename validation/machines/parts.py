"""Recordings of a machine as its rivals see them, and the simulation of models with friction.

A rival models the force that the nominal model lacks. Where a rig imposes the motion, it predicts the measured force;
otherwise the axis is simulated from its first state (Runge-Kutta method of fourth order) and predicts the position.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.signal import savgol_filter

from hand_machine.description import MachineDescription
from hand_machine.reading import Readings
from validation.trial.arrays import Array, Flags

SMOOTHED_S, SHARE_OF_OSCILLATION = (0.01, 0.02, 0.04, 0.06), 0.15
"""Halves of the window of derivatives to choose from, each at most this share of the nominal model's oscillation."""
STANDSTILL = 0.02
"""Speed around which friction changes its sign, in standard deviations of the speed."""
STEPS_PER_OSCILLATION = 40.0
LARGEST = 1e6
"""Bound of a simulated position, in standard deviations of the measured one."""
Law = Callable[[Array], Array]
"""Force (n,) over states (n, 4): position, speed, input, smooth sign of the speed."""


@dataclass(frozen=True, slots=True)
class Part:
    """One recording, or a stretch of one. states (n, 4), see Law.  acceleration (n,).  target (n,): the measured force
    or position.  lacking (n,): force that the nominal model lacks.  known (n,): samples that are evaluated.
    """

    period_s: float
    states: Array
    acceleration: Array
    target: Array
    lacking: Array
    known: Flags

    def cut(self, first: int, last: int) -> Part:
        """A stretch of it."""
        at = slice(first, last)
        columns = (self.states[at], self.acceleration[at], self.target[at], self.lacking[at], self.known[at])
        return Part(self.period_s, *columns)


def parts_of(described: MachineDescription, train: Sequence[Readings], test: Sequence[Readings]) -> list[Part]:
    """The recordings with their derivatives, first the training recordings; the sign of the speed is smoothed alike.

    The window of the derivatives is the one with which linear terms and Coulomb friction explain the training
    recordings best.
    """
    longest_s = np.inf
    if described.stiffness > 0.0 and described.inertia > 0.0:
        longest_s = SHARE_OF_OSCILLATION * 2.0 * np.pi * float(np.sqrt(described.inertia / described.stiffness))
    halves = sorted({min(half_s, longest_s) for half_s in SMOOTHED_S})
    left = [_unexplained(_smoothed(described, train, half_s), imposed=described.imposed) for half_s in halves]
    half_s = halves[int(np.argmin(left))]
    return _smoothed(described, [*train, *test], half_s, len(train))


def _smoothed(
    described: MachineDescription, readings: Sequence[Readings], half_s: float, train: int | None = None
) -> list[Part]:
    """train: number of recordings, from the first, whose speed sets the smoothing of its sign; None: all."""
    motions = [_motion(each, half_s) for each in readings]
    still = STANDSTILL * float(np.std(np.concatenate([v for _, v, _ in motions[:train]])))
    return [_part(described, each, motion, still) for each, motion in zip(readings, motions, strict=True)]


def _unexplained(parts: Sequence[Part], *, imposed: bool) -> float:
    """What a regression of the lacking force on motion and direction leaves.

    The acceleration is a regressor only where it is not in the lacking force of a moved axis itself.
    """
    columns = [np.column_stack([part.states, *([part.acceleration] if imposed else [])]) for part in parts]
    states = np.concatenate([rows[part.known] for rows, part in zip(columns, parts, strict=True)])
    features = np.column_stack([states / np.maximum(states.std(axis=0), 1e-300), np.ones(len(states))])
    lacking = np.concatenate([part.lacking[part.known] for part in parts])
    left = np.asarray(lacking - features @ np.linalg.lstsq(features, lacking, rcond=None)[0], dtype=np.float64)
    return float(np.std(left))


def _motion(table: Readings, half_s: float) -> tuple[Array, Array, Array]:
    """Position, speed and acceleration (n,), smoothed."""
    span = max(2 * round(half_s / table.period_s) + 1, 5)
    x, v, a = (savgol_filter(table.signals["position"], span, 3, deriv=k, delta=table.period_s) for k in range(3))
    return x, v, a


def _part(described: MachineDescription, table: Readings, motion: tuple[Array, Array, Array], still: float) -> Part:
    x, v, a = motion
    given = table.signals["input"]
    passive = described.stiffness * x + described.damping * v + described.inertia * a + described.weight * np.sin(x)
    lacking = passive - described.gain * given
    if described.imposed:
        lacking = lacking + table.signals["force"]
    states = np.column_stack([x, v, given, np.tanh(v / still)])
    target = table.signals["force" if described.imposed else "position"]
    return Part(table.period_s, states, a, target, lacking, table.known)


def split(parts: Sequence[Part], share: float) -> tuple[list[Part], list[Part]]:
    """The first stretch of each recording to fit, and the rest to choose. share: of the rest [-]."""
    ends = [round((1.0 - share) * len(part.target)) for part in parts]
    first = [part.cut(0, end) for part, end in zip(parts, ends, strict=True)]
    rest = [part.cut(end, len(part.target)) for part, end in zip(parts, ends, strict=True)]
    return first, rest


def simulate(described: MachineDescription, part: Part, still: float, law: Law) -> Array:
    """Positions (n,) of the nominal model with the force of a law added, from the first state of a part.

    still: speed around which the sign of the speed is smoothed [m/s or rad/s].
    """
    x, v = float(part.states[0, 0]), float(part.states[0, 1])
    bound = LARGEST * float(np.std(part.target)) + 1.0
    given, h, out = part.states[:, 2], part.period_s, np.empty(len(part.target))

    def acceleration(position: float, speed: float, drive: float) -> float:
        state = np.array([[position, speed, drive, np.tanh(speed / still)]])
        force = float(law(state)[0]) + described.gain * drive - described.damping * speed
        passive = described.stiffness * position + described.weight * float(np.sin(position))
        return (force - passive) / described.inertia

    for n in range(len(out)):
        out[n] = x
        drive = given[min(n + 1, len(out) - 1)]
        middle = 0.5 * (given[n] + drive)
        a1 = acceleration(x, v, given[n])
        v2 = v + 0.5 * h * a1
        a2 = acceleration(x + 0.5 * h * v, v2, middle)
        v3 = v + 0.5 * h * a2
        a3 = acceleration(x + 0.5 * h * v2, v3, middle)
        v4 = v + h * a3
        a4 = acceleration(x + h * v3, v4, drive)
        x = float(np.clip(x + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4), -bound, bound))
        v = float(np.clip(v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4), -bound / h, bound / h))
    return out


@njit(cache=True)
def _acceleration(x, v, u, p):  # type: ignore[no-untyped-def]
    """Acceleration of an axis with the numbers p of `friction_positions`."""
    pull = p[1] * x + p[4] * np.sin(x) + p[5] * np.cos(x) + p[6]
    load = abs(p[0] * u - pull)
    dry = p[7] + p[8] * load + p[9] * np.exp(-((v / (5.0 * p[11])) ** 2))
    return (p[0] * u - pull - (p[2] + p[10] * abs(v)) * v - dry * np.tanh(v / p[11])) / p[3]


@njit(cache=True)
def friction_positions(x, v, given, h, steps, p):  # type: ignore[no-untyped-def]
    """Positions (n,) from a first state; Runge-Kutta method.

    p: gain, stiffness, damping, inertia, weight by sine and cosine, constant force, friction: Coulomb, by load,
    Stribeck, quadratic; the speed around which friction changes its sign.  steps: per sample.
    """
    out = np.empty(len(given))
    k = h / steps
    for n in range(len(given)):
        out[n] = x
        after = given[min(n + 1, len(given) - 1)]
        for i in range(steps):
            u1 = given[n] + (after - given[n]) * i / steps
            u3 = given[n] + (after - given[n]) * (i + 1) / steps
            u2 = 0.5 * (u1 + u3)
            a1 = _acceleration(x, v, u1, p)
            v2 = v + 0.5 * k * a1
            a2 = _acceleration(x + 0.5 * k * v, v2, u2, p)
            v3 = v + 0.5 * k * a2
            a3 = _acceleration(x + 0.5 * k * v2, v3, u2, p)
            v4 = v + k * a3
            a4 = _acceleration(x + k * v3, v4, u3, p)
            x += k / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
            v += k / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
            if not abs(x) < 1e9:
                x, v = 1e9, 0.0
    return out
