"""The three-zone material law of the actuator's silicone, Eq. 12 and 13.

A is the creeping ratio, 0 ... 1. The zones join continuously in A', so the law reads without branches:
extension max(0, (b1 (p - p_min) - A) / (b1/b3)) plus recovery min(0, (b0 p - A) / (b0/b2)); where both are
zero the material holds. Well-posed for b0 >= b1 and p_min > 0; A stays in [0, 1] for b1 (p_max - p_min) <= 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hand_model.arrays import Array
from hand_model.compile_cache import njit


@njit(cache=True, forceinline=True, fastmath={"contract", "nnan", "nsz"})
def creep_rate(p, creep, p_min, b1, extension_rate, b0, recovery_rate):  # type: ignore[no-untyped-def]
    """A' [1/s] at pressure p [Pa]; extension_rate = b3/b1 and recovery_rate = b2/b0 [1/s] (Eq. 12)."""
    extension = (b1 * (p - p_min) - creep) * extension_rate
    recovery = (b0 * p - creep) * recovery_rate
    return max(extension, 0.0) + min(recovery, 0.0)


def mean_rate(time_s: Any, h: float) -> Any:
    """(1 - exp(-h / T)) / h [1/s]: in place of 1 / T in Eq. 12, a step of h [s] at constant pressure is exact."""
    return -np.expm1(-h / time_s) / h


def creep_course(pressure_pa: Array, law: tuple[float, ...], period_s: float, ratio: float = 0.0) -> Array:
    """Creeping ratio of Eq. 12 (n + 1,) before each of n pressures [Pa], each held for period_s [s], and after them.

    law: p_min [Pa], b1 [1/Pa], time constant of extension [s], b0 [1/Pa], time constant of recovery [s].  ratio: at
    the first pressure.
    """
    p_min, b1, extension_s, b0, recovery_s = law
    rates = mean_rate(extension_s, period_s), mean_rate(recovery_s, period_s)
    course = np.empty(len(pressure_pa) + 1)
    course[0] = ratio
    _advance(course, pressure_pa, period_s, p_min, b1, rates[0], b0, rates[1])
    return course


@njit(cache=True)
def _advance(course, pressure, period_s, p_min, b1, extension, b0, recovery):  # type: ignore[no-untyped-def]
    for k in range(len(pressure)):
        course[k + 1] = course[k] + period_s * creep_rate(pressure[k], course[k], p_min, b1, extension, b0, recovery)
