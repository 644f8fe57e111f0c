"""The board emulator: the simulated plant behind real bytes, with a board's rules and, on request, its faults."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from typing import Protocol

import numpy as np

from hand_driver.board import Counts, Pressures, Status
from hand_sim.faults import Faults, FaultState
from hand_sim.port import Port, Sample


class EmulatedPlant(Protocol):
    """What the emulator samples; hand_sim.plant.SimulatedPlant is one."""

    def step(self, pressure_pa: Pressures) -> tuple[Counts, float, Status]:
        """Hold set-points (valves,) [Pa] for one period; return counts, sensor supply [V], status."""


class Emulator:
    """A board: at each tick it samples, then takes over what has arrived, and vents what outlived its lifetime."""

    def __init__(
        self,
        plant: EmulatedPlant,
        open_port: Callable[[], Port],
        rate_hz: float,
        valves: int,
        faults: Faults | None = None,
        seed: int = 0,
    ) -> None:
        """Open the port and wait for run; the board's clock starts at 0."""
        self._plant = plant
        self._open_port = open_port
        self._period_s = 1.0 / rate_hz
        self._valves = valves
        self._faults = FaultState(faults or Faults(), seed)
        self._port: Port | None = open_port()
        self._in_force = np.zeros(valves)
        self._vent_at_tick = -1
        self._late: deque[tuple[float, Sample, bool]] = deque()
        self._unplug_for_s = 0.0
        self._unplugged_until_s = 0.0

    @property
    def description(self) -> str:
        """Of the port, for people."""
        return self._port.description if self._port is not None else "unplugged"

    def run(self, stop: Callable[[], bool]) -> None:
        """Serve in real time until stop() is true."""
        begun_s = time.monotonic()
        tick = 0
        while not stop():
            tick += 1
            wait_s = begun_s + tick * self._period_s - time.monotonic()
            if wait_s > 0.0:
                time.sleep(wait_s)
            self.tick(tick)

    def unplug(self, lasting_s: float) -> None:
        """Pull the cable at the next tick and plug it in again lasting_s [s] later; safe in a signal handler."""
        self._unplug_for_s = lasting_s

    def close(self) -> None:
        """Unplug for good."""
        if self._port is not None:
            self._port.close()
            self._port = None

    def tick(self, tick: int) -> None:
        """Sample number tick, 1 for the first."""
        now_s = tick * self._period_s
        counts, supply_v, status = self._plant.step(self._in_force)
        if tick > self._vent_at_tick:
            status |= Status.VENTED
        sample = Sample((tick - 1) & 0xFFFFFFFF, round(now_s * 1e6), supply_v, status, self._faults.counts(counts))
        self._plug(now_s)
        if not self._faults.dropped():
            self._late.append((now_s + self._faults.faults.delay_s, sample, self._faults.corrupted()))
        while self._late and self._late[0][0] <= now_s + 1e-9:
            _, due, corrupt = self._late.popleft()
            if self._port is not None:
                self._port.send(due, corrupt)
        self._take_over(tick)

    def _plug(self, now_s: float) -> None:
        if self._unplug_for_s > 0.0:
            self._unplugged_until_s, self._unplug_for_s = now_s + self._unplug_for_s, 0.0
        connected = now_s >= self._unplugged_until_s and self._faults.faults.connected(now_s)
        if connected and self._port is None:
            self._port = self._open_port()
        elif not connected:
            self.close()

    def _take_over(self, tick: int) -> None:
        orders = self._port.receive() if self._port is not None else []
        for order in orders:
            if len(order.pressure_pa) == self._valves:
                self._in_force = np.array(order.pressure_pa)
                # Counted in ticks: sums of rounded seconds would grant some set-points a period more.
                self._vent_at_tick = tick + math.ceil(order.lifetime_s / self._period_s - 1e-6)
        if tick >= self._vent_at_tick:
            self._in_force = np.zeros(self._valves)
