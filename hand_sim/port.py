"""What the board emulator needs of a port: the board's side of a real link, bytes or CAN messages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from hand_driver.board import Counts, Pressures, Status


@dataclass(frozen=True, slots=True)
class Sample:
    """What the board sends: sequence, board_time_us [us], supply_voltage_v [V], status, counts uint16 (channels,)."""

    sequence: int
    board_time_us: int
    supply_voltage_v: float
    status: Status
    counts: Counts


@dataclass(frozen=True, slots=True)
class Order:
    """What the board accepts: pressure_pa (valves,) [Pa gauge], lifetime_s [s] from arrival."""

    pressure_pa: Pressures
    lifetime_s: float


class Port(Protocol):
    """The board's end of a link, open."""

    def send(self, sample: Sample, corrupt: bool = False) -> None:
        """Send one sample; with corrupt, damage it on the way as noise on the wire would. Never blocks for long."""

    def receive(self) -> list[Order]:
        """Every valid order that has arrived since the last call; invalid ones are ignored. Never blocks."""

    def close(self) -> None:
        """Pull the plug: the other side sees a disconnect."""

    @property
    def description(self) -> str:
        """For people: "serial /tmp/hand 1000000 baud"."""
