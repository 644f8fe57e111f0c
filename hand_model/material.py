"""The three-zone material law of the actuator's silicone, Eq. 12 and 13.

A is the creeping ratio, 0 ... 1. The zones join continuously in A', so the law reads without branches:
extension max(0, (b1 (p - p_min) - A) / (b1/b3)) plus recovery min(0, (b0 p - A) / (b0/b2)); where both are
zero the material holds. Well-posed for b0 >= b1 and p_min > 0; A stays in [0, 1] for b1 (p_max - p_min) <= 1.
"""

from __future__ import annotations

from hand_model.compile_cache import njit


@njit(cache=True, forceinline=True, fastmath={"contract", "nnan", "nsz"})
def creep_rate(p, creep, p_min, b1, extension_rate, b0, recovery_rate):  # type: ignore[no-untyped-def]
    """A' [1/s] at pressure p [Pa]; extension_rate = b3/b1 and recovery_rate = b2/b0 [1/s] (Eq. 12)."""
    extension = (b1 * (p - p_min) - creep) * extension_rate
    recovery = (b0 * p - creep) * recovery_rate
    return max(extension, 0.0) + min(recovery, 0.0)
