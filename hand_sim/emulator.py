"""The board emulator: the simulated plant behind a real link, with the rules of a board and, on request, faults."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

from hand_driver.board import Counts, Pressures, SetPointsInForce, Status
from hand_driver.negotiation import BoardSession
from hand_driver.wire import SamplePayload, SetPointPayload
from hand_sim.faults import Faults, FaultState


class BoardEndpoint(Protocol):
    """The board's end of an open link, for bytes or CAN messages. It answers the offers of the host by itself."""

    @property
    def session(self) -> BoardSession | None:
        """What the board has agreed on with its host; None for a link without versions."""
        return None

    def send(self, sample: SamplePayload, corrupt: bool = False) -> None:
        """Send one sample; with corrupt, damage it on the way as noise on the wire would. Never blocks for long."""

    def receive(self) -> list[SetPointPayload]:
        """All set-points accepted since the last call; invalid, repeated and old ones are ignored. Never blocks."""

    def close(self) -> None:
        """Disconnect: the other side sees the link end."""

    @property
    def description(self) -> str:
        """Kind, name and rate of the link, for people: "serial /tmp/hand 1000000 baud"."""


def in_session(sample: SamplePayload, session: BoardSession) -> SamplePayload:
    """A sample in the version of a session; version 1 carries no echo."""
    if session.version == sample.version:
        return sample
    return replace(sample, version=session.version, echo=sample.echo if session.version > 1 else None)


class EmulatedPlant(Protocol):
    """What the emulator samples; hand_sim.plant.SimulatedPlant is one."""

    def step(self, pressure_pa: Pressures) -> tuple[Counts, float, Status]:
        """Hold set-points (valves,) [Pa] for one period; return counts, sensor supply [V], status."""


class Emulator:
    """A board: at each tick it samples, then takes over the set-points that have arrived, and vents expired ones."""

    def __init__(
        self,
        plant: EmulatedPlant,
        open_endpoint: Callable[[], BoardEndpoint],
        rate_hz: float,
        valves: int,
        faults: Faults | None = None,
        *,
        seed: int = 0,
        now: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Open the endpoint and wait for run; the board's clock starts at 0. now, sleep: of the host, [s]."""
        self._plant = plant
        self._open_endpoint = open_endpoint
        self._period_s = 1.0 / rate_hz
        self._valves = valves
        self._now, self._sleep = now, sleep
        self._faults = FaultState(faults or Faults(), seed)
        self._endpoint: BoardEndpoint | None = open_endpoint()
        self._in_force = SetPointsInForce(valves, self._period_s)
        self._late: deque[tuple[float, SamplePayload, bool]] = deque()
        self._host: int | None = None
        self._first_tick = 0
        self._sent: deque[SamplePayload] = deque(maxlen=100)
        self._restart_asked = False
        self._unplug_for_s = 0.0
        self._unplugged_until_s = 0.0

    @property
    def description(self) -> str:
        """Kind, name and rate of the link, for people."""
        return self._endpoint.description if self._endpoint is not None else "unplugged"

    def run(self, stop: Callable[[], bool]) -> None:
        """Serve in real time until stop() is true. Samples of a time in which this process stood still are lost.

        Sent all at once, they would look like the frames of a board that takes no set-points.
        """
        begun_s = self._now()
        tick = 0
        while not stop():
            tick += 1
            wait_s = begun_s + tick * self._period_s - self._now()
            if wait_s > 0.0:
                self._sleep(wait_s)
            self.tick(tick, lost=wait_s < -self._period_s)

    def unplug(self, lasting_s: float) -> None:
        """Disconnect at the next tick and connect again lasting_s [s] later; safe in a signal handler."""
        self._unplug_for_s = lasting_s

    def close(self) -> None:
        """Disconnect finally."""
        if self._endpoint is not None:
            self._endpoint.close()
            self._endpoint = None

    def tick(self, tick: int, lost: bool = False) -> None:
        """Sample number tick, 1 for the first. lost: it is not sent, and no set-points are received."""
        now_s = tick * self._period_s
        if self._restart_asked or self._faults.restarts(now_s):
            self._restart(tick)
        counts, supply_v, status = self._plant.step(self._in_force.pressure_pa)
        if self._in_force.vented(tick):
            status |= Status.VENTED
        run_s = (tick - self._first_tick) * self._period_s
        sample = SamplePayload(
            (tick - self._first_tick - 1) & 0xFFFFFFFF,
            round(run_s * 1e6 * (1.0 + self._faults.faults.clock_error)),
            supply_v,
            status,
            self._faults.counts(counts),
            echo=self._in_force.echo(tick),
        )
        self._plug(now_s)
        if not (lost or self._faults.dropped()):
            self._late.append((now_s + self._faults.faults.delay_s, sample, self._faults.corrupted()))
        while self._late and self._late[0][0] <= now_s + 1e-9:
            _, due, corrupt = self._late.popleft()
            if self._endpoint is not None:
                self._endpoint.send(due, corrupt)
                self._repeat(due)
        if lost:
            self._in_force.take_over(tick)
        else:
            self._take_over(tick)

    def _repeat(self, sample: SamplePayload) -> None:
        self._sent.append(sample)
        if self._endpoint is not None and self._faults.repeated():
            self._endpoint.send(self._sent[0])

    def restart(self) -> None:
        """Restart the board at the next tick, as after a loss of its power; safe in a signal handler."""
        self._restart_asked = True

    def _restart(self, tick: int) -> None:
        self._restart_asked = False
        self._first_tick = tick - 1
        self._in_force = SetPointsInForce(self._valves, self._period_s)
        session = self._endpoint.session if self._endpoint is not None else None
        if session is not None:
            session.restart()

    def _plug(self, now_s: float) -> None:
        if self._unplug_for_s > 0.0:
            self._unplugged_until_s, self._unplug_for_s = now_s + self._unplug_for_s, 0.0
        connected = now_s >= self._unplugged_until_s and self._faults.faults.connected(now_s)
        if connected and self._endpoint is None:
            self._endpoint = self._open_endpoint()
        elif not connected:
            self.close()

    def _take_over(self, tick: int) -> None:
        received = self._endpoint.receive() if self._endpoint is not None else []
        session = self._endpoint.session if self._endpoint is not None else None
        if session is not None and session.session != self._host:
            self._host = session.session
            self._in_force.forget_sender()
        for set_points in received:
            if len(set_points.pressure_pa) == self._valves and self._faults.taken_over(tick * self._period_s):
                held = self._faults.set_points(set_points.pressure_pa)
                self._in_force.take_over(tick, held, set_points.lifetime_s, set_points.sequence)
        self._in_force.take_over(tick)
