"""The evaluation of a board: each fault is found and named, and a good board has none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_driver.board import Counts, Frame, LinkCounters, Pressures, Status
from hand_driver.board_check import BoardCheck, BoardResult
from hand_driver.wire import SamplePayload, SetPointPayload
from hand_model.description import load_hand
from hand_sim.emulator import BoardEndpoint, Emulator
from hand_sim.faults import Faults
from hand_sim.plant import SimulatedPlant

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
PERIOD_NS = 5_000_000


class Pipe(BoardEndpoint):
    """A link in virtual time."""

    def __init__(self) -> None:
        self.to_board: list[SetPointPayload] = []
        self.frames: list[SamplePayload] = []

    @property
    def description(self) -> str:
        return "pipe"

    def send(self, sample: SamplePayload, corrupt: bool = False) -> None:
        self.frames.append(sample)

    def receive(self) -> list[SetPointPayload]:
        arrived, self.to_board = self.to_board, []
        return arrived

    def close(self) -> None:
        return


class NoisyPlant(SimulatedPlant):
    """A plant with ten times the noise on one channel, where one is given."""

    noisy: int | None = None

    def step(self, pressure_pa: Pressures) -> tuple[Counts, float, object]:  # type: ignore[override]
        counts, supply_v, status = super().step(pressure_pa)
        if self.noisy is not None:
            counts[self.noisy] += np.uint16(self._rng.integers(0, 400))
        return counts, supply_v, status


def checked(
    faults: Faults | None = None,
    version: int = 2,
    counters: LinkCounters | None = None,
    test: tuple[int, float] | None = None,
    noisy: int | None = None,
    frames: int = 600,
) -> BoardResult:
    """The result for an emulated board with faults."""
    plant = NoisyPlant(HAND, 200.0, seed=1)
    plant.noisy = noisy
    pipe, check, sequence = Pipe(), BoardCheck(HAND), 0
    emulator = Emulator(plant, lambda: pipe, 200.0, HAND.valve_count, faults or Faults(), seed=2)  # type: ignore[arg-type]
    pressure_pa = np.zeros(HAND.valve_count)
    if test is not None:
        pressure_pa[test[0]] = test[1]
    for tick in range(1, frames + 321):
        emulator.tick(tick)
        now_ns, sample = tick * PERIOD_NS, pipe.frames.pop(0)
        echo = sample.echo if version > 1 else None
        frame = Frame(
            sample.sequence, sample.board_time_us, sample.supply_voltage_v, sample.status, sample.counts, now_ns, echo
        )
        if tick <= frames:
            check.read(frame)
        if tick == frames:
            check.finish_reading(counters or LinkCounters(), version, frames / 200.0)
        if frames < tick <= frames + 200:
            check.driven(frame)
            pipe.to_board.append(SetPointPayload(sequence, 0.1, pressure_pa, 1))
            check.sent(sequence, pressure_pa, 0.1, now_ns)
            sequence += 1
        elif tick > frames + 200:
            check.released(frame)
    return check.finish(test)


@pytest.mark.parametrize("version", [1, 2])
def test_a_good_board_has_no_fault(version: int) -> None:
    """Fails when a healthy board is accused, or a figure of it is wrong."""
    result = checked(version=version, test=(3, 2e4))
    assert result.faults == []
    assert result.rate_hz == pytest.approx(200.0)
    assert result.clock_rate == pytest.approx(1.0, abs=1e-6)
    assert result.set_points == "followed, and vented after their lifetime"
    assert [channel.measures for channel in result.channels][:4][-1] == "index_proximal angle"
    assert any("watched" in line or "does not echo" in line for line in result.remarks) is (version == 1)
    assert any(line.startswith("index_proximal: ") for line in result.remarks)


@pytest.mark.parametrize(
    ("what", "line"),
    [
        ({"faults": Faults(stuck={14: None})}, "channel 14 (index_proximal pressure) is dead"),
        ({"faults": Faults(stuck={3: 65535})}, "channel 3 (index_proximal angle) is at the rail"),
        ({"noisy": 5}, "channel 5 (middle_proximal angle) is noisy"),
        ({"faults": Faults(clock_error=-0.01)}, "clock is 1.00 % slow (rate 0.99"),
        ({"faults": Faults(deaf=((0.0, 99.0),))}, "takes no set-points"),
        ({"faults": Faults(deaf=((0.0, 99.0),)), "version": 1}, "takes no set-points"),
        ({"faults": Faults(deaf_valves=(3,)), "test": (3, 2e4)}, "index_proximal: the board holds 0.00 bar"),
        ({"faults": Faults(deaf_valves=(3,)), "test": (3, 2e4), "version": 1}, "kPa measured for 20.0 kPa"),
        ({"counters": LinkCounters(dropped=20)}, "20 of 620 frames are lost"),
        ({"counters": LinkCounters(corrupt=20)}, "20 of 620 frames are corrupt"),
        ({"counters": LinkCounters(replayed=20)}, "20 of 620 frames are repeated or old"),
    ],
)
def test_each_fault_is_found_and_named(what: dict[str, object], line: str) -> None:
    """Fails when a fault of the board is not found, or its line does not name what to look at."""
    result = checked(**what)  # type: ignore[arg-type]
    assert any(line in fault for fault in result.faults), result.faults
    assert result.as_json()["verdict"] == "faults"


def test_a_silent_board_and_a_wrong_bit_rate_are_distinguished() -> None:
    """Fails when the reader of a silent line is sent to look for noise, or the other way round."""
    silent = BoardCheck(HAND).finish_reading(LinkCounters(), 1, 3.0)
    assert silent.faults == ["0 frames arrived in 3.0 s; check the power of the board, the cable and the port"]
    noise = BoardCheck(HAND).finish_reading(LinkCounters(corrupt=7), 1, 3.0)
    assert "check the bit rate" in noise.faults[0]
    assert silent.as_json()["rate_hz"] is None


def test_a_watchdog_that_does_not_vent_is_found() -> None:
    """Fails when a board that keeps its set-points for ever passes."""
    check = BoardCheck(HAND)
    counts = np.full(HAND.channel_count, 5000, np.uint16)
    for k in range(400):
        frame = Frame(k, k * 5000, 5.0, Status(0), counts, k * PERIOD_NS)
        if k < 200:
            check.driven(frame)
            check.sent(k, np.zeros(HAND.valve_count), 0.1, k * PERIOD_NS)
        else:
            check.released(frame)
    assert any("watchdog does not work" in fault for fault in check.finish(None).faults)
