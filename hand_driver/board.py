"""The board protocol: what the driver asks of anything that measures the hand and drives its valves.

A board is a source of frames and a sink of set-points. Its clock runs on its own; its watchdog
vents every valve when the lifetime of the last set-points has passed.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array

Counts = NDArray[np.uint16]
Pressures = Array


class BoardError(Exception):
    """The board cannot be used as asked; the message is one line for its user."""


class LinkLost(BoardError):
    """The connection is gone (cable pulled, port closed); opening it again may help."""


class ProtocolMismatch(BoardError):
    """The other side speaks another protocol version or has another channel count."""


class Status(IntFlag):
    """Status bits of a frame."""

    VENTED = 1  # no set-points in force: none received yet, or the last ones outlived their lifetime
    SUPPLY_LOW = 2  # the pressure supply is below what the set-points ask for
    OVER_PRESSURE = 4  # an actuator is above its limit; the board vents it by itself
    ADC_FAULT = 8  # a conversion failed; the counts of this frame are not to be trusted


@dataclass(frozen=True, slots=True)
class Frame:
    """One sample of every channel.

    sequence: the board's frame counter, 0 ... 2**32 - 1, wraps.
    board_time_us: the board's clock at acquisition [us], unsigned 64 bit, starts anywhere.
    supply_voltage_v: supply of the ratiometric sensors [V].
    status: Status bits.
    counts: uint16 (channels,), read-only.
    received_ns: the host's monotonic clock [ns] when the frame was complete.
    """

    sequence: int
    board_time_us: int
    supply_voltage_v: float
    status: Status
    counts: Counts
    received_ns: int


@dataclass(slots=True)
class LinkCounters:
    """What happened on the link since the board was opened."""

    frames: int = 0  # good frames handed over
    dropped: int = 0  # frames missing in the sequence
    corrupt: int = 0  # byte strings or messages that were no valid frame
    written: int = 0  # sets of set-points sent


class Board(Protocol):
    """A board, opened. Not thread-safe except that `write` may run beside `read`."""

    @property
    def counters(self) -> LinkCounters:
        """Counters of this connection."""

    def read(self, timeout_s: float) -> Frame | None:
        """Wait for the next good frame, or return None after timeout_s [s].

        Raises LinkLost when the connection is gone, ProtocolMismatch when the board speaks otherwise.
        """

    def write(self, pressure_pa: Pressures, lifetime_s: float) -> None:
        """Send one set-point [Pa gauge] per valve, valid for lifetime_s [s] from arrival.

        Values are finite and within the supply range: the caller has checked them.
        Raises LinkLost when the connection is gone.
        """

    def close(self) -> None:
        """Release the port; harmless when repeated. The board's own watchdog vents the hand."""
