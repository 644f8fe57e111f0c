"""Experiments: set-points that excite an effect, within the joint's pressure, torque and angle limits.

Each is a function of time for one joint. Several joints run it with shifted phases, so that coupled joints move
differently. The torque limit is kept by a pressure ceiling: a joint at rest against an obstacle gives at most Eq. 6's
torque at its own angle, so the ceiling is taken at the angle where that torque is largest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.kernel.rows import ROW
from hand_model.statics import leverage, pressure_for_torque

Shape = Callable[[Array, np.random.Generator], Array]
"""Time (T,) [s] to a level (T,) in 0 ... 1 of the allowed pressure."""


def _held(levels: Sequence[float] | Array, time_s: Array) -> Array:
    index = np.minimum((time_s / time_s[-1] * len(levels)).astype(int), len(levels) - 1)
    held: Array = np.asarray(levels, dtype=np.float64)[index]
    return held


def _staircase(time_s: Array, rng: np.random.Generator) -> Array:
    del rng
    return _held([*np.linspace(0, 1, 7), *np.linspace(1, 0, 7)[1:]], time_s)


def _slow_triangle(time_s: Array, rng: np.random.Generator) -> Array:
    phase = 3.0 * time_s / time_s[-1] + 0.25 * rng.random()
    return np.asarray(1.0 - np.abs(2.0 * (phase % 1.0) - 1.0), dtype=np.float64)


def _steps(time_s: Array, rng: np.random.Generator) -> Array:
    return _held(rng.random(max(4, round(time_s[-1] / 0.8))), time_s)


def _multisine(time_s: Array, rng: np.random.Generator) -> Array:
    waves = [np.sin(2 * np.pi * f * time_s + 2 * np.pi * rng.random()) for f in np.geomspace(0.1, 5.0, 10)]
    return np.asarray(np.clip(0.5 + 0.11 * np.sum(waves, axis=0), 0.0, 1.0), dtype=np.float64)


def _chirp(time_s: Array, rng: np.random.Generator) -> Array:
    del rng
    end, low, high = float(time_s[-1]), 0.1, 5.0
    rate = np.log(high / low) / end
    return np.asarray(0.5 + 0.4 * np.sin(2 * np.pi * low * (np.exp(rate * time_s) - 1.0) / rate))


def _hold(time_s: Array, rng: np.random.Generator) -> Array:
    del rng
    return _held([0.0, *([0.6] * 6), *([0.15] * 3)], time_s)


def _free_decay(time_s: Array, rng: np.random.Generator) -> Array:
    del rng
    return _held([0.7, 0.0] * max(2, round(time_s[-1] / 8.0)), time_s)


def _closed_valve_push(time_s: Array, rng: np.random.Generator) -> Array:
    """A constant pressure, against which the operator pushes by hand."""
    del rng
    return np.full_like(time_s, 0.4)


def _reversals(time_s: Array, rng: np.random.Generator) -> Array:
    """Triangles of shrinking amplitude about the middle: every reversal at another level."""
    del rng
    turns = 8.0 * time_s / time_s[-1]
    amplitude = 0.5 * (1.0 - time_s / time_s[-1])
    return np.asarray(0.5 + amplitude * (4.0 * np.abs((turns % 1.0) - 0.5) - 1.0))


def _taps(time_s: Array, rng: np.random.Generator) -> Array:
    """Short closings from a low pressure, as against an object."""
    del rng
    return np.where((time_s % 4.0) < 1.5, 0.8, 0.1)


EXPERIMENTS: dict[str, Shape] = {
    "staircase": _staircase,
    "slow_triangle": _slow_triangle,
    "steps": _steps,
    "multisine": _multisine,
    "chirp": _chirp,
    "hold": _hold,
    "free_decay": _free_decay,
    "closed_valve_push": _closed_valve_push,
    "reversals": _reversals,
    "taps": _taps,
}


def set_points(
    name: str, hand: Hand, joints: Sequence[str], duration_s: float, max_pressure_pa: float, seed: int
) -> Array:
    """Set-points (T, joints) [Pa] of all joints of a hand at the board's rate; joints that are not named stay vented.

    Raises ValueError for an unknown experiment or joint, or a duration or pressure outside its range.
    """
    if name not in EXPERIMENTS:
        raise ValueError(f"experiment is {name!r}; it must be one of {', '.join(EXPERIMENTS)}")
    if not 2.0 <= duration_s <= 3600.0:
        raise ValueError(f"--duration is {duration_s:g}; the allowed range is 2 to 3600 s")
    count = round(duration_s * hand.rate_hz)
    time_s = np.arange(count) / hand.rate_hz
    commands = np.zeros((count, len(hand.joints)))
    for number, joint in enumerate(joints):
        if joint not in hand.joints:
            raise ValueError(f"--joints: {joint!r} is unknown; known here: {', '.join(hand.joints)}")
        j = hand.joints.index(joint)
        ceiling = min(pressure_ceiling_pa(hand, j), max_pressure_pa)
        level = EXPERIMENTS[name](time_s, np.random.default_rng([seed, number]))
        commands[:, j] = ceiling * np.clip(np.roll(level, round(0.13 * number * count) if number else 0), 0.0, 1.0)
    return commands


def pressure_ceiling_pa(hand: Hand, joint: int) -> float:
    """Pressure at which no angle of the range gives more than the joint's maximum torque, Eq. 6."""
    a0, a1, a2, a3 = hand.parameters[ROW["statics.a0_nm"] : ROW["statics.a3_nm_per_pa_rad"] + 1, joint]
    angles = np.linspace(hand.limits.low_rad[joint], hand.limits.high_rad[joint], 50)
    pushing = angles[leverage(angles, a2, a3) > 0.0]
    allowed = pressure_for_torque(hand.limits.max_torque_nm[joint], pushing, 0.0, a0, a1, a2, a3, 0.0)
    return float(min(np.min(allowed, initial=np.inf), hand.limits.max_pressure_pa[joint], hand.supply_pressure_pa))
