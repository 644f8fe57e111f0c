"""Shaping of the reference: what the joint is really asked to follow, with a speed that never jumps.

A critically damped second-order filter follows target and target speed; a trajectory that is smooth already
passes without lag, a step becomes a motion the valve can follow. w is its bandwidth [rad/s]:

    v' = w^2 (target - r) + 2 w (target' - v),   r' = v,   |v| <= the greatest speed
"""

from __future__ import annotations

import numpy as np
from numba import njit

from hand_model.arrays import Array


@njit(cache=True)
def _shape(r, v, acc, target, target_speed, bandwidth, max_speed, dt):  # type: ignore[no-untyped-def]
    steps = max(1, int(np.ceil(2.0 * bandwidth * dt / 0.2)))  # the explicit step stays well inside stability
    h = dt / steps
    for i in range(len(r)):
        before = v[i]
        for _ in range(steps):
            a = bandwidth * bandwidth * (target[i] - r[i]) + 2.0 * bandwidth * (target_speed[i] - v[i])
            v[i] = min(max(v[i] + a * h, -max_speed), max_speed)
            r[i] += v[i] * h
        acc[i] = (v[i] - before) / dt if dt > 0.0 else 0.0


class Shaper:
    """The shaped reference r [rad], its speed v [rad/s] and acceleration a [rad/s^2], (n,) each."""

    def __init__(self, joints: int) -> None:
        """Begin at 0; latch before use."""
        self.r = np.zeros(joints)
        self.v = np.zeros(joints)
        self.a = np.zeros(joints)

    def latch(self, position: Array) -> None:
        """Stand still at position (n,) [rad]."""
        self.r[:], self.v[:], self.a[:] = position, 0.0, 0.0

    def step(self, target: Array, target_speed: Array, bandwidth: float, max_speed: float, dt: float) -> None:
        """Follow target [rad] and its speed [rad/s] for dt [s]."""
        _shape(self.r, self.v, self.a, target, target_speed, bandwidth, max_speed, dt)
