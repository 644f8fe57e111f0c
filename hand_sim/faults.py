"""Faults of a board and its link, injected on request; pure functions with a seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from hand_driver.board import Counts, Pressures


class FaultError(ValueError):
    """The description of a fault is invalid; the message is one line."""


@dataclass(frozen=True, slots=True)
class Faults:
    """The faults to inject.

    drop, corrupt: probability of losing or damaging a frame.  delay_s: extra latency [s] of every frame.
    disconnect: (at, for) [s] pairs during which the link is disconnected.  stuck: counts by channel that never change;
    None holds the first count seen.  repeat: probability of sending an earlier frame once more.  deaf: (at, for) [s]
    pairs during which set-points are not taken over.  deaf_valves: valves that stay at 0 Pa.  lose: probability of
    losing a packet of set-points.  restart: times [s] at which the board restarts.  clock_error: relative error of the
    board's clock, positive where it is fast.
    """

    drop: float = 0.0
    corrupt: float = 0.0
    delay_s: float = 0.0
    disconnect: tuple[tuple[float, float], ...] = ()
    stuck: dict[int, int | None] = field(default_factory=dict)
    repeat: float = 0.0
    deaf: tuple[tuple[float, float], ...] = ()
    deaf_valves: tuple[int, ...] = ()
    lose: float = 0.0
    restart: tuple[float, ...] = ()
    clock_error: float = 0.0

    def __post_init__(self) -> None:
        """Raise FaultError for values outside their range."""
        for name, value, low, high in (
            ("drop", self.drop, 0.0, 1.0),
            ("corrupt", self.corrupt, 0.0, 1.0),
            ("delay", self.delay_s, 0.0, 1.0),
            ("repeat", self.repeat, 0.0, 1.0),
            ("lose", self.lose, 0.0, 1.0),
            ("clock-error", self.clock_error, -0.5, 0.5),
        ):
            if not low <= value <= high:
                raise FaultError(f"{name} is {value:g}; the allowed range is {low:g} to {high:g}")

    def connected(self, time_s: float) -> bool:
        """Whether the link is connected, time_s [s] after the start."""
        return not any(at <= time_s < at + lasting for at, lasting in self.disconnect)

    def hears(self, time_s: float) -> bool:
        """Whether set-points are taken over, time_s [s] after the start."""
        return not any(at <= time_s < at + lasting for at, lasting in self.deaf)


class FaultState:
    """Faults with their state: random numbers and held counts."""

    def __init__(self, faults: Faults, seed: int) -> None:
        """The seed determines the random faults."""
        self.faults = faults
        self._rng = np.random.default_rng(seed)
        self._held: dict[int, int] = {}
        self._restarts = sorted(faults.restart)

    def restarts(self, time_s: float) -> bool:
        """Whether the board restarts now, time_s [s] after the start; True once for each restart."""
        due = bool(self._restarts) and time_s >= self._restarts[0]
        if due:
            del self._restarts[0]
        return due

    def repeated(self) -> bool:
        """Whether an earlier frame is sent once more."""
        return bool(self.faults.repeat) and bool(self._rng.random() < self.faults.repeat)

    def taken_over(self, time_s: float) -> bool:
        """Whether the board takes over a packet of set-points that has arrived, time_s [s] after the start."""
        lost = bool(self.faults.lose) and bool(self._rng.random() < self.faults.lose)
        return self.faults.hears(time_s) and not lost

    def set_points(self, pressure_pa: Pressures) -> Pressures:
        """Set-points (valves,) [Pa] as the valves take them."""
        held = np.array(pressure_pa)
        held[list(self.faults.deaf_valves)] = 0.0
        return held

    def dropped(self) -> bool:
        """Whether this frame is lost."""
        return bool(self._rng.random() < self.faults.drop)

    def corrupted(self) -> bool:
        """Whether this frame is damaged."""
        return bool(self._rng.random() < self.faults.corrupt)

    def counts(self, counts: Counts) -> Counts:
        """Counts (channels,) with the values of stuck channels."""
        for channel, value in self.faults.stuck.items():
            held = self._held.setdefault(channel, int(counts[channel]) if value is None else value)
            counts[channel] = held
        return counts


def parse_disconnect(text: str, name: str = "disconnect") -> tuple[float, float]:
    """ "AT_S:FOR_S" as two times [s]; name: of the option. Raises FaultError."""
    at, _, lasting = text.partition(":")
    try:
        pair = float(at), float(lasting)
    except ValueError:
        raise FaultError(f"{name} is {text!r}; it must be AT:FOR in seconds, for example 3:1.5") from None
    if not (0.0 <= pair[0] < 1e6 and 0.0 < pair[1] < 1e6):
        raise FaultError(f"{name} is {text!r}; AT must be 0 or more and FOR above 0 seconds")
    return pair


def parse_stuck(text: str, channels: int, full_scale: int) -> tuple[int, int | None]:
    """ "CHANNEL" or "CHANNEL=COUNT". Raises FaultError."""
    channel, _, count = text.partition("=")
    try:
        pair = int(channel), int(count) if count else None
    except ValueError:
        raise FaultError(f"stuck is {text!r}; it must be CHANNEL or CHANNEL=COUNT") from None
    if not 0 <= pair[0] < channels or not 0 <= (pair[1] or 0) <= full_scale:
        raise FaultError(f"stuck is {text!r}; channels are 0 to {channels - 1}, counts 0 to {full_scale}")
    return pair


def check_valves(numbers: Sequence[int], valves: int) -> tuple[int, ...]:
    """Numbers of valves. Raises FaultError for one that the hand does not have."""
    for number in numbers:
        if not 0 <= number < valves:
            raise FaultError(f"deaf-valve is {number}; valves are 0 to {valves - 1}")
    return tuple(numbers)
