"""Whether one frame's measurements can be true; compiled, because every frame passes here."""

from __future__ import annotations

import math

from numba import njit

FINE, NOT_FINITE, JUMPED = range(3)


@njit(cache=True)
def implausible(position, velocity, pressure, last_position, max_jump):  # type: ignore[no-untyped-def]
    """Verdict and the joint it is about: the first not finite, else the one that jumped furthest.

    position and last_position [rad], velocity [rad/s], pressure [Pa]: (joints,).  max_jump: [rad] between frames.
    """
    worst, furthest = 0, max_jump
    for j in range(len(position)):
        if not math.isfinite(position[j] + velocity[j] + pressure[j]):
            return NOT_FINITE, j
        jump = abs(position[j] - last_position[j])
        if jump > furthest:
            worst, furthest = j, jump
    return (JUMPED if furthest > max_jump else FINE), worst
