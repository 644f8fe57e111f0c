"""What may reach the board: nothing but 0 Pa while a fault of the driver is latched.

The driver latches independently of the controller. A latched fault stays until `reset_driver`. Times are nanoseconds of
one monotonic clock and are arguments.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from hand_driver.set_points import SetPoints

BEFORE_NS = 100_000_000
"""A hold takes the least set-points of this time: a second commander may have been obeyed until it was noticed."""
SHORTEST_S = 1e-3
"""Least lifetime that a board accepts."""


class Guard:
    """The latch of the driver, and the set-points that it last let through. Another thread may trip it."""

    def __init__(self, fault: str = "") -> None:
        """Begin with a fault that is latched already, or with none."""
        self.fault = fault
        self._written: deque[tuple[int, SetPoints]] = deque()

    def trip(self, fault: str) -> None:
        """Latch a fault; the first one is kept. The caller then writes 0 Pa."""
        self.fault = self.fault or fault
        self.forget()

    def forget(self) -> None:
        """Nothing is in force any more, as after a vent. A latched fault stays."""
        self._written = deque()  # not cleared in place: another thread may be reading it

    def reset(self) -> str:
        """Clear the latch and return the fault, empty where there was none."""
        fault, self.fault = self.fault, ""
        return fault

    def refusal(self, set_points: SetPoints, objection: str = "") -> str:
        """Why set-points must not be written, one line; empty where they may. 0 Pa on every valve always may.

        objection: a reason that is not latched, empty for none.
        """
        if not set_points.pressure_pa.any():
            return ""
        if self.fault:
            return f"valve_command refused: a fault is latched ({self.fault}); call reset_driver"
        return f"valve_command refused: {objection}" if objection else ""

    def written(self, set_points: SetPoints, now_ns: int) -> None:
        """Remember the set-points that were written at now_ns. Pressure is not remembered while a fault is latched."""
        if self.fault and set_points.pressure_pa.any():
            return
        written = self._written
        written.append((now_ns, set_points))
        while len(written) > 1 and written[1][0] < now_ns - BEFORE_NS:  # what was in force BEFORE_NS ago stays
            written.popleft()

    def held(self, now_ns: int) -> SetPoints | None:
        """The set-points to write again while the hand holds, the least of the last BEFORE_NS; None: it is vented."""
        written = self._written
        if not self.driving(now_ns) or not written:
            return None
        return replace(written[-1][1], pressure_pa=np.min([points.pressure_pa for _, points in written], axis=0))

    def in_force(self, now_ns: int) -> SetPoints | None:
        """The set-points that were last let through, with what is left of their lifetime; None where it has ended."""
        written = self._written
        if not written:
            return None
        since_ns, last = written[-1]
        left_s = last.lifetime_s - (now_ns - since_ns) * 1e-9
        return replace(last, lifetime_s=left_s) if left_s >= SHORTEST_S else None

    def driving(self, now_ns: int) -> bool:
        """Whether pressure above 0 Pa was written and is within its lifetime."""
        written = self._written
        if not written:
            return False
        since_ns, last = written[-1]
        return now_ns < since_ns + round(last.lifetime_s * 1e9) and bool(last.pressure_pa.any())
