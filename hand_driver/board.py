"""The board protocol: what the driver needs of a device that measures the hand and drives its valves.

A board is a source of frames and a sink of set-points. It has its own clock. Its watchdog vents every valve when the
lifetime of the last set-points has passed; `SetPointsInForce` is this rule, for every simulated board and every replay.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntFlag
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array

Counts = NDArray[np.uint16]
Pressures = Array


class BoardError(Exception):
    """The board cannot be used as asked; the message is one line for its user."""


class LinkLost(BoardError):
    """The connection is lost (cable pulled, port closed); opening it again may help."""


class ProtocolMismatch(BoardError):
    """The board has another protocol version or another number of channels."""


class Status(IntFlag):
    """Status bits of a frame."""

    VENTED = 1  # no set-points in force: none received yet, or the last ones outlived their lifetime
    SUPPLY_LOW = 2  # the pressure supply is below what the set-points ask for
    OVER_PRESSURE = 4  # an actuator is above its limit; the board vents it by itself
    ADC_FAULT = 8  # a conversion failed; the counts of this frame are not valid


@dataclass(frozen=True, slots=True)
class Echo:
    """The set-points that a board has in force, as the board itself reports them.

    sequence: of the packet that brought them.  age_s: time since the board accepted that packet [s]; NaN where it has
    accepted none.  pressure_pa: (valves,) [Pa gauge], 0 where the board is vented.  accepted: number of set-point
    packets that the board has accepted, modulo 2**8.
    """

    sequence: int
    age_s: float
    pressure_pa: Pressures
    accepted: int = 0


@dataclass(frozen=True, slots=True)
class Frame:
    """One sample of every channel.

    sequence: the board's frame counter, 0 ... 2**32 - 1, wraps.
    board_time_us: the board's clock at acquisition [us], unsigned 64 bit, starts anywhere.
    supply_voltage_v: supply of the ratiometric sensors [V].
    status: Status bits.
    counts: uint16 (channels,), read-only.
    received_ns: the host's monotonic clock [ns] when the frame was complete.
    echo: the set-points in force at acquisition; None where the board sends none (protocol version 1).
    """

    sequence: int
    board_time_us: int
    supply_voltage_v: float
    status: Status
    counts: Counts
    received_ns: int
    echo: Echo | None = None


@dataclass(slots=True)
class LinkCounters:
    """Counts of events on the link since the board was opened."""

    frames: int = 0  # good frames handed over
    dropped: int = 0  # frames missing in the sequence
    corrupt: int = 0  # byte strings or messages that were not a valid frame
    written: int = 0  # sets of set-points sent
    replayed: int = 0  # frames that repeat an earlier one, or are older than one: not handed over
    restarts: int = 0  # restarts of the board


class Board(Protocol):
    """A board, opened. Not thread-safe except that `write` may run during `read`."""

    @property
    def counters(self) -> LinkCounters:
        """Counters of this connection."""

    @property
    def protocol(self) -> int:
        """Protocol version in use; a board of version 1 does not echo its set-points."""
        return 1

    def read(self, timeout_s: float) -> Frame | None:
        """Wait for the next good frame, or return None after timeout_s [s].

        Raises LinkLost when the connection is lost, ProtocolMismatch when the board has another protocol.
        """

    def continue_from(self, former: Board) -> None:
        """Take over from the former connection what recognises a restart of the board in between."""
        return

    def renew(self) -> None:
        """Ask the board to clear a fault that it has latched; a board that latches none needs nothing."""
        return

    def write(self, pressure_pa: Pressures, lifetime_s: float) -> int | None:
        """Send one set-point [Pa gauge] per valve, valid for lifetime_s [s] from arrival; returns their sequence.

        Values are finite and within the supply range: the caller has checked them.
        Raises LinkLost when the connection is lost.
        """

    def close(self) -> None:
        """Release the port; further calls have no effect. The board's watchdog vents the hand."""


def lifetime_ticks(lifetime_s: Any, period_s: float) -> Any:
    """Number of ticks for which a board with a sample period [s] holds set-points of a lifetime [s]; at least 1.

    A scalar or an array. A thousandth of a period is allowed for rounding: whole periods must not gain one by it.
    """
    return np.maximum(np.ceil(np.asarray(lifetime_s) / period_s - 1e-3), 1.0).astype(np.int64)


class SetPointsInForce:
    """The set-points that a board holds: the newest received, from the tick that takes them over to their lifetime.

    Before the first set-points and after the lifetime of the last ones, the board holds 0 Pa: it is vented.
    """

    def __init__(self, valves: int, period_s: float) -> None:
        """Begin vented. period_s: sample period of the board [s]."""
        self._period_s = period_s
        self.pressure_pa: Pressures = np.zeros(valves)
        self.vent_at_tick = -1
        self._sequence = 0
        self._accepted = 0
        self._accepted_at_tick = -1

    def take_over(
        self, tick: int, pressure_pa: Pressures | None = None, lifetime_s: float = 0.0, sequence: int = 0
    ) -> None:
        """End tick number `tick`: take over set-points (valves,) [Pa] where some arrived, and vent expired ones."""
        if pressure_pa is not None:
            self.pressure_pa = np.array(pressure_pa, dtype=np.float64)
            self.vent_at_tick = tick + int(lifetime_ticks(lifetime_s, self._period_s))
            self._sequence, self._accepted_at_tick = sequence, tick
            self._accepted = (self._accepted + 1) & 0xFF
        if tick >= self.vent_at_tick:
            self.pressure_pa = np.zeros_like(self.pressure_pa)

    def forget_sender(self) -> None:
        """Begin a session: number and count the set-points from 0. Those in force stay until their lifetime ends."""
        self._sequence, self._accepted, self._accepted_at_tick = 0, 0, -1

    def echo(self, tick: int) -> Echo:
        """What the sample of a tick reports of the set-points in force while it was taken."""
        age_s = (tick - self._accepted_at_tick) * self._period_s if self._accepted_at_tick >= 0 else math.nan
        return Echo(self._sequence, age_s, self.pressure_pa, self._accepted)

    def vented(self, tick: int) -> bool:
        """Whether the sample of a tick was taken without set-points in force."""
        return tick > self.vent_at_tick
