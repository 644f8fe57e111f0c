"""The simulated board: the plant in (scaled) real time behind the board protocol.

It behaves like a board with a sample clock: at each tick it converts every channel, then takes over the set-points
that have arrived since the previous tick; `SetPointsInForce` vents those that are older than their lifetime.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np

from hand_driver.board import Board, Frame, LinkCounters, LinkLost, Pressures, SetPointsInForce, Status
from hand_sim.plant import SimulatedPlant


class SimulatedBoard(Board):
    """Plant, sample clock and watchdog. Board time starts at start_us and runs `speed` times real time."""

    def __init__(
        self,
        plant: SimulatedPlant,
        rate_hz: float,
        speed: float = 1.0,
        *,
        start_us: int = 0,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Sample plant at rate_hz [Hz]; a test may pass a clock and a sleep other than those of the host."""
        self._plant = plant
        self._period_ns = 1e9 / rate_hz
        self._wall_ns = self._period_ns / speed
        self._start_us = start_us
        self._now = monotonic_ns
        self._sleep = sleep
        self._begun_ns = monotonic_ns()
        self._tick = 0
        self._lock = threading.Lock()
        self._pending: list[tuple[Pressures, float, int]] = []
        self._in_force = SetPointsInForce(plant.hand.valve_count, 1.0 / rate_hz)
        self._closed = False
        self._counters = LinkCounters()

    @property
    def counters(self) -> LinkCounters:
        """Counters; a simulated link corrupts nothing."""
        return self._counters

    @property
    def protocol(self) -> int:
        """Version 2: frames carry the echo of the set-points in force."""
        return 2

    def write(self, pressure_pa: Pressures, lifetime_s: float) -> int:
        """Set-points [Pa], taken over at the next tick. Raises LinkLost once the board is closed."""
        if self._closed:
            raise LinkLost("the simulated board is closed")
        with self._lock:
            sequence = self._counters.written & 0xFFFFFFFF
            self._pending.append((np.array(pressure_pa), lifetime_s, sequence))
            self._counters.written += 1
        return sequence

    def read(self, timeout_s: float) -> Frame | None:
        """Wait for the next tick (or timeout_s [s]) and sample. Raises LinkLost once the board is closed."""
        if self._closed:
            raise LinkLost("the simulated board is closed")
        due_ns = self._begun_ns + (self._tick + 1) * self._wall_ns
        wait_s = (due_ns - self._now()) * 1e-9
        if wait_s > timeout_s:
            self._sleep(timeout_s)
            return None
        if wait_s > 0.0:
            self._sleep(wait_s)
        else:
            self._lose(int(-wait_s * 1e9 / self._wall_ns))
        return self._sample()

    def close(self) -> None:
        """Stop; the valves vent."""
        self._closed = True

    def _sample(self) -> Frame:
        counts, supply_v, status = self._plant.step(self._in_force.pressure_pa)
        self._tick += 1
        vented, echo = self._in_force.vented(self._tick), self._in_force.echo(self._tick)
        self._take_over()
        self._counters.frames += 1
        return Frame(
            sequence=(self._tick - 1) & 0xFFFFFFFF,
            board_time_us=self._start_us + round(self._tick * self._period_ns * 1e-3),
            supply_voltage_v=supply_v,
            status=status | (Status.VENTED if vented else Status(0)),
            counts=counts,
            received_ns=self._now(),
            echo=echo,
        )

    def _lose(self, ticks: int) -> None:
        """Advance the hand over whole ticks that the host missed; their frames are lost."""
        driven = max(0, min(ticks, self._in_force.vent_at_tick - self._tick))
        for count in (driven, ticks - driven):
            if count:
                self._plant.plant.advance(np.repeat(self._in_force.pressure_pa[None], count, axis=0))
            self._tick += count
            self._in_force.take_over(self._tick)
        self._counters.dropped += ticks

    def _take_over(self) -> None:
        with self._lock:
            arrived, self._pending = self._pending, []
        for pressure_pa, lifetime_s, sequence in arrived:
            self._in_force.take_over(self._tick, pressure_pa, lifetime_s, sequence)
        self._in_force.take_over(self._tick)
