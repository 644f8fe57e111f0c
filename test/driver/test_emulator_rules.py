"""The emulated board keeps the simulated board's rules at every tick and for every lifetime."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hand_driver.board import Counts, Pressures, Status
from hand_driver.wire import SamplePayload, SetPointPayload
from hand_sim.emulator import BoardEndpoint, Emulator

VALVES = 3


class Plant:
    """Remembers which periods it was driven in."""

    def __init__(self) -> None:
        self.driven: list[bool] = []

    def step(self, pressure_pa: Pressures) -> tuple[Counts, float, Status]:
        self.driven.append(bool(pressure_pa.any()))
        return np.zeros(3, np.uint16), 5.0, Status(0)


class OneSetPoint(BoardEndpoint):
    """Gives one order at a tick of choice and keeps the status bits that are sent."""

    def __init__(self, at: int, lifetime_s: float) -> None:
        self._left, self._lifetime_s = at, lifetime_s
        self.vented: list[bool] = []

    @property
    def description(self) -> str:
        return "one order"

    def send(self, sample: SamplePayload, corrupt: bool = False) -> None:
        self.vented.append(Status.VENTED in sample.status)

    def receive(self) -> list[SetPointPayload]:
        self._left -= 1
        return [SetPointPayload(0, self._lifetime_s, np.full(VALVES, 1e5))] if self._left == 0 else []

    def close(self) -> None:
        return


@pytest.mark.parametrize("rate_hz", [200.0, 500.0, 1000.0])
@pytest.mark.parametrize("lifetime_ms", [1, 7, 100, 290])
def test_a_lifetime_is_the_same_number_of_periods_at_any_time(lifetime_ms: int, rate_hz: float) -> None:
    """Fails when rounding grants a set-point one period beyond its lifetime, or the status bit disagrees."""
    periods = math.ceil(lifetime_ms * round(rate_hz) / 1000)
    for at in (*range(1, 60), 1234, 99_999):
        port, plant = OneSetPoint(1, lifetime_ms * 1e-3), Plant()
        emulator = Emulator(plant, lambda port=port: port, rate_hz, VALVES)  # type: ignore[misc]
        for tick in range(at, at + periods + 4):
            emulator.tick(tick)
        expected = [1 <= k <= periods for k in range(periods + 4)]
        assert plant.driven == expected, at
        assert port.vented == [not driven for driven in expected], at


class StallingClock:
    """The host's time [s]; one sleep lasts much longer than asked for."""

    def __init__(self, stall_at: int, stall_s: float) -> None:
        self.now_s, self._sleeps, self._stall_at, self._stall_s = 0.0, 0, stall_at, stall_s

    def now(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self._sleeps += 1
        self.now_s += seconds + (self._stall_s if self._sleeps == self._stall_at else 0.0)


class Sequences(OneSetPoint):
    """Keeps the numbers of what is sent."""

    def __init__(self) -> None:
        super().__init__(0, 0.1)
        self.numbers: list[int] = []

    def send(self, sample: SamplePayload, corrupt: bool = False) -> None:
        self.numbers.append(sample.sequence)


def test_samples_of_a_stalled_host_are_lost() -> None:
    """Fails when an emulator that stood still sends the samples of that time at once, or its hand stands still."""
    clock, port, plant = StallingClock(10, 0.1), Sequences(), Plant()
    emulator = Emulator(plant, lambda: port, 200.0, VALVES, now=clock.now, sleep=clock.sleep)
    emulator.run(lambda: clock.now_s > 0.3)
    missing = sorted(set(range(port.numbers[-1] + 1)) - set(port.numbers))
    assert 18 <= len(missing) <= 20 and missing == list(range(missing[0], missing[0] + len(missing)))
    assert len(plant.driven) == port.numbers[-1] + 1
