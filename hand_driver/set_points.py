"""Valve commands: checked as a whole, then put into the order of the valves. Only these set-points reach a valve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hand_messages.bounds import MAX_NAMES, BoundError, check_bytes, shown
from hand_messages.cdr import Layout, LayoutError
from hand_messages.layouts import VALVE_COMMAND
from hand_model.arrays import Array
from hand_model.description import Hand

FUTURE_S = 0.1
"""A stamp further ahead than this is of another clock."""
MAX_LIFETIME_S = 1.0
"""Longest lifetime of a set-point that is accepted."""


class RefusedError(ValueError):
    """The whole command is refused; the message is one line."""


@dataclass(frozen=True, slots=True)
class SetPoints:
    """Checked set-points: pressure_pa (valves,) [Pa gauge] in the hand's order, lifetime_s [s], stamp_ns [ns]."""

    pressure_pa: Array
    lifetime_s: float
    stamp_ns: int


class CommandReader:
    """Reads ValveCommand messages from their bytes for one hand."""

    def __init__(self, hand: Hand) -> None:
        """Check against the joints and limits of this hand."""
        self._hand = hand
        self._layout: Layout | None = None
        self._order: NDArray[np.int64] = np.arange(hand.valve_count)

    def read(self, raw: bytes, now_ns: int) -> SetPoints:
        """Check a serialized message received at now_ns. Raises RefusedError."""
        try:
            if self._layout is None or not self._layout.matches(raw):
                check_bytes(len(raw))
                self._learn(Layout.like(VALVE_COMMAND, raw, MAX_NAMES))
            assert self._layout is not None
            values = self._layout.decode(raw)
        except (LayoutError, BoundError) as error:
            raise RefusedError(f"valve_command refused: {error}") from None
        lifetime_s = values["lifetime_ns"] * 1e-9
        pressure_pa = values["pressure"][self._order]
        self._check_time(lifetime_s, values["stamp_ns"], now_ns)
        self._check_pressure(pressure_pa)
        return SetPoints(pressure_pa, lifetime_s, values["stamp_ns"])

    def _learn(self, layout: Layout) -> None:
        names = layout.names
        joints = self._hand.joints
        pressures = layout.shape.lengths["pressure"]
        if pressures != len(names):
            raise RefusedError(
                f"valve_command refused: {len(names)} names but {pressures} pressures [Pa]; one each is needed"
            )
        _check_names(names, joints)
        self._order = np.array([names.index(joint) for joint in joints], dtype=np.int64)
        self._layout = layout

    def _check_time(self, lifetime_s: float, stamp_ns: int, now_ns: int) -> None:
        if not 0.0 < lifetime_s <= MAX_LIFETIME_S:
            allowed = f"above 0 to {MAX_LIFETIME_S:g} s"
            raise RefusedError(f"valve_command refused: lifetime is {lifetime_s:g} s; allowed is {allowed}")
        age_s = (now_ns - stamp_ns) * 1e-9
        if age_s > lifetime_s:
            raise RefusedError(
                f"valve_command refused: stamp is {age_s:.3f} s old; at most its lifetime, {lifetime_s:g} s, is allowed"
            )
        if age_s < -FUTURE_S:
            raise RefusedError(
                f"valve_command refused: stamp is {-age_s:.3f} s in the future; at most {FUTURE_S:g} s is allowed"
            )

    def _check_pressure(self, pressure_pa: Array) -> None:
        limit = self._hand.limits.max_pressure_pa
        bad = ~((pressure_pa >= 0.0) & (pressure_pa <= limit))  # NaN fails both comparisons
        if bad.any():
            worst = int(np.argmax(bad))
            raise RefusedError(
                f"valve_command refused: {self._hand.joints[worst]} pressure is {pressure_pa[worst]:g} Pa; "
                f"the allowed range is 0 to {limit[worst]:g} Pa"
            )


def _check_names(names: Sequence[str], joints: Sequence[str]) -> None:
    known, seen = set(joints), set[str]()
    for name in names:
        if name not in known:
            raise RefusedError(f"valve_command refused: unknown joint {shown(name)}; joints are {', '.join(joints)}")
        if name in seen:
            raise RefusedError(f"valve_command refused: joint {name!r} appears twice")
        seen.add(name)
    missing = [joint for joint in joints if joint not in seen]
    if missing:
        raise RefusedError(f"valve_command refused: joint {missing[0]!r} is missing; each valve needs a set-point")
