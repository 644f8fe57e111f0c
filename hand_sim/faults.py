"""Faults of a board and its link, injected on request; pure functions with a seed."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hand_driver.board import Counts


class FaultError(ValueError):
    """The description of a fault is invalid; the message is one line."""


@dataclass(frozen=True, slots=True)
class Faults:
    """The faults to inject.

    drop, corrupt: probability of losing or damaging a frame.  delay_s: extra latency [s] of every frame.
    disconnect: (at, for) [s] pairs during which the link is disconnected.  stuck: counts by channel that never change;
    None holds the first count seen.
    """

    drop: float = 0.0
    corrupt: float = 0.0
    delay_s: float = 0.0
    disconnect: tuple[tuple[float, float], ...] = ()
    stuck: dict[int, int | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Raise FaultError for values outside their range."""
        for name, value, high in (
            ("drop", self.drop, 1.0),
            ("corrupt", self.corrupt, 1.0),
            ("delay", self.delay_s, 1.0),
        ):
            if not 0.0 <= value <= high:
                raise FaultError(f"{name} is {value:g}; the allowed range is 0 to {high:g}")

    def connected(self, time_s: float) -> bool:
        """Whether the link is connected, time_s [s] after the start."""
        return not any(at <= time_s < at + lasting for at, lasting in self.disconnect)


class FaultState:
    """Faults with their state: random numbers and held counts."""

    def __init__(self, faults: Faults, seed: int) -> None:
        """The seed determines the random faults."""
        self.faults = faults
        self._rng = np.random.default_rng(seed)
        self._held: dict[int, int] = {}

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


def parse_disconnect(text: str) -> tuple[float, float]:
    """ "AT_S:FOR_S" as two times [s]. Raises FaultError."""
    at, _, lasting = text.partition(":")
    try:
        pair = float(at), float(lasting)
    except ValueError:
        raise FaultError(f"disconnect is {text!r}; it must be AT:FOR in seconds, for example 3:1.5") from None
    if not (0.0 <= pair[0] < 1e6 and 0.0 < pair[1] < 1e6):
        raise FaultError(f"disconnect is {text!r}; AT must be 0 or more and FOR above 0 seconds")
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
