"""The chain closed: the plant of a hand whose description has effects of the catalogue.

The steps are those of chain.py; here one stage feeds the next, and lanes are the joints of one hand. What a joint
feels of its neighbours (the partner's acceleration, a neighbour's angle, the hand's flow) is that of the last step.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import carray, njit
from numpy.typing import NDArray

from hand_model.chain import (
    CREEP,
    OMEGA,
    PHI,
    STATES,
    WORK,
    P,
    X,
    angle_sensor,
    at_actuator,
    creep_step,
    joint_step,
    prepare,
    read_angle,
    read_pressure,
    replacing_valve,
    valve_replaced,
    valve_step,
)
from hand_model.kernel.hooks import active_effects, equations_key
from hand_model.kernel.inline import FAST, inline
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW, STARTS, STEP_S
from hand_model.stack_rows import stack_doubles

Array = NDArray[np.float64]
MAX_JOINTS = 16
_DEAD = ROW["valve.dead_time_s"]
_SUPPLY = ROW["supply.pressure_pa"]
_HISTORY = 64
_COMMAND, _ACCELERATION, _RISE = WORK, WORK + 1, WORK + 2
_ALL = WORK + 3
_SIZE = _ALL * MAX_JOINTS


@inline
def _delivered(history, head, i, x, y):  # type: ignore[no-untyped-def]
    """Mean set-point of joint i between the positions x <= y, in samples after the newest one; both at most 1."""
    a, b = math.floor(x), math.floor(y)
    first, second = history[(head + a) % _HISTORY, i], history[(head + min(b, 0)) % _HISTORY, i]
    share = (y - b) / (y - x) if b > a else 1.0
    return first + share * (second - first)


def _kernel() -> Any:
    key = equations_key()

    def advance(work, history, head, commands, partner, neighbour, clock, dt, steps, out):  # type: ignore[no-untyped-def]
        _ = key
        w = carray(stack_doubles(_SIZE), (_ALL, MAX_JOINTS))
        for row in range(_ALL):
            for i in range(MAX_JOINTS):
                w[row, i] = work[row, i]
        joints, h = commands.shape[1], dt / steps
        for i in range(MAX_JOINTS):
            prepare(w, i, h)
        for k in range(commands.shape[0]):
            head = (head + 1) % _HISTORY
            for i in range(joints):
                history[head, i] = commands[k, i]
            for n in range(steps):
                inflow = 0.0
                for i in range(joints):
                    inflow += max(w[_RISE, i], 0.0)
                for i in range(joints):
                    lag = w[_DEAD, i] / dt
                    w[_COMMAND, i] = _delivered(history, head, i, n / steps - lag, (n + 1) / steps - lag)
                for i in range(joints):
                    shared = w[_ACCELERATION, partner[i]] if partner[i] >= 0 else 0.0
                    phi, omega, p = w[X + PHI, i], w[X + OMEGA, i], w[X + P, i]
                    e = (clock, w[X + PHI, neighbour[i]], inflow, shared, phi, omega, w[_ACCELERATION, i])
                    if valve_replaced(w, i):
                        command = min(max(w[_COMMAND, i], 0.0), w[_SUPPLY, i])
                        w[X + P, i] = replacing_valve(w, i, p, command, e, h)
                    else:
                        w[X + P, i] = valve_step(w, i, p, w[_COMMAND, i], e, h)
                    w[_RISE, i] = (w[X + P, i] - p) / h
                    middle = at_actuator(w, i, 0.5 * (p + w[X + P, i]), h)
                    creep = w[X + CREEP, i]
                    w[X + PHI, i], w[X + OMEGA, i] = joint_step(w, i, phi, omega, middle, creep, e, h)
                    w[X + CREEP, i] = creep_step(w, i, middle, creep, h)
                    angle_sensor(w, i, w[X + PHI, i], h)
                    w[_ACCELERATION, i] += 0.5 * ((w[X + OMEGA, i] - omega) / h - w[_ACCELERATION, i])
                clock += h
            for i in range(joints):
                out[k, P, i] = read_pressure(w, i, w[X + P, i])
                out[k, PHI, i] = read_angle(w, i, w[X + PHI, i])
                out[k, OMEGA, i] = w[X + OMEGA, i]
                out[k, CREEP, i] = w[X + CREEP, i]
        for row in range(_ALL):
            for i in range(MAX_JOINTS):
                work[row, i] = w[row, i]
        return head, clock

    return njit(cache=True, fastmath=FAST, error_model="numpy")(advance)


_advance = _kernel()


class ClosedChain:
    """The joints of one hand with effects, Eqs. 6 to 13 and the catalogue, advanced sample by sample."""

    def __init__(self, parameters: Array, partner: NDArray[np.int64], state: Array, period_s: float) -> None:
        """Begin at state (STATES, joints) with parameters (rows, joints) and coupled joints partner (joints,) or -1.

        A joint's neighbour, where an effect needs one, is its partner, or else the joint before it.
        """
        joints = parameters.shape[1]
        if joints > MAX_JOINTS:
            raise ValueError(f"{joints} joints have effects; the closed chain holds at most {MAX_JOINTS}")
        self._work = np.zeros((_ALL, MAX_JOINTS))
        self._work[: len(JOINT_PARAMETERS), :joints] = parameters
        self._work[: len(JOINT_PARAMETERS), joints:] = parameters[:, -1:]
        self._work[X : X + STATES, :joints] = state
        for row, kind in STARTS:
            self._work[row, :joints] = state[PHI] if kind == "angle" else state[P]
        before = np.maximum(np.arange(joints) - 1, 0)
        self._partner = np.asarray(partner, dtype=np.int64)
        self._neighbour = np.where(self._partner >= 0, self._partner, before)
        self._history = np.zeros((_HISTORY, MAX_JOINTS))
        self._head, self._clock = 0, 0.0
        self._period_s = period_s
        self._steps = max(1, math.ceil(period_s / STEP_S - 1e-9))
        longest = float(parameters[_DEAD].max())
        if longest > (_HISTORY - 2) * period_s:
            raise ValueError(
                f"valve.dead_time_s is {longest:g}; the allowed range is 0 to {(_HISTORY - 2) * period_s:g}"
            )

    @property
    def state(self) -> Array:
        """True state (STATES, joints) now."""
        state: Array = self._work[X : X + STATES, : len(self._partner)].copy()
        return state

    def hold_history(self, pressure_pa: Array) -> None:
        """Fill the dead-time memory as if pressure_pa (joints,) had been commanded for long."""
        self._history[:, : len(pressure_pa)] = pressure_pa

    def advance(self, commands: Array) -> Array:
        """Apply set-points (samples, joints) [Pa]; return states as the sensors see them (samples, STATES, joints)."""
        out = np.empty((len(commands), STATES, commands.shape[1]))
        self._head, self._clock = _advance(
            self._work, self._history, self._head, np.ascontiguousarray(commands), self._partner, self._neighbour,
            self._clock, self._period_s, self._steps, out,
        )  # fmt: skip
        return out


def has_effects(parameters: Array) -> bool:
    """Whether any parameter (rows, joints) of an effect is switched on."""
    return bool(active_effects(parameters))
