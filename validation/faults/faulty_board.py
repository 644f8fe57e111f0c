"""An emulated serial board that gets a fault by a signal: python -m validation.faults.faulty_board PATH FAULT.

SIGUSR1 begins the fault, SIGUSR2 ends it. FAULT is deaf (takes no set-points), half_deaf (takes one in ten), mute
(takes set-points and sends no frames), restarted (clock, sequence and set-points begin again), over_pressure (reports
it and vents) or supply_lost (sensors without supply).

Example: python -m validation.faults.faulty_board /tmp/board deaf
"""

from __future__ import annotations

import argparse
import signal
import sys
import time
from pathlib import Path
from types import FrameType

import numpy as np

from hand_driver.board import Counts, Pressures, Status
from hand_driver.negotiation import HIGHEST, BoardSession
from hand_driver.wire import SamplePayload, SetPointPayload
from hand_sim.emulator import Emulator
from hand_sim.plant import SimulatedPlant
from hand_sim.serial_endpoint import SerialEndpoint
from validation.faults.closed_loop import description

FAULTS = ("deaf", "half_deaf", "mute", "restarted", "over_pressure", "supply_lost")
TAKEN = 0.1
"""Share of the packets that a half deaf board takes."""


class FaultyPlant:
    """The simulated hand, whose sensors can lose their supply and whose board can report over-pressure."""

    def __init__(self, seed: int) -> None:
        """Begin without a fault."""
        self._plant = SimulatedPlant(description(), description().rate_hz, seed)
        self.fault = ""

    def step(self, pressure_pa: Pressures) -> tuple[Counts, float, Status]:
        """See hand_sim.emulator.EmulatedPlant."""
        if self.fault == "over_pressure":
            counts, supply_v, status = self._plant.step(np.zeros_like(pressure_pa))
            return counts, supply_v, status | Status.OVER_PRESSURE | Status.VENTED
        counts, supply_v, status = self._plant.step(pressure_pa)
        return counts, 0.0 if self.fault == "supply_lost" else supply_v, status


class FaultySerial(SerialEndpoint):
    """A serial endpoint that loses packets of the host, or its own, while the fault lasts."""

    def __init__(self, path: str, plant: FaultyPlant, rng: np.random.Generator) -> None:
        """Serve at path."""
        super().__init__(path)
        self._plant = plant
        self._rng = rng

    def restart(self) -> None:
        """Forget the host, as a board does that restarts."""
        self._session = BoardSession(HIGHEST)

    def send(self, sample: SamplePayload, corrupt: bool = False) -> None:
        """See BoardEndpoint.send."""
        if self._plant.fault != "mute":
            super().send(sample, corrupt)

    def receive(self) -> list[SetPointPayload]:
        """See BoardEndpoint.receive."""
        received = super().receive()
        if self._plant.fault == "deaf":
            return []
        if self._plant.fault == "half_deaf":
            return [payload for payload in received if self._rng.random() < TAKEN]
        return received


def main() -> int:
    """Serve until SIGINT or SIGTERM; exit code 0."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.faults.faulty_board",
        description="Serve an emulated board that gets a fault by SIGUSR1 and loses it by SIGUSR2.",
        epilog="Example: python -m validation.faults.faulty_board /tmp/board deaf",
    )
    parser.add_argument("path", type=Path)
    parser.add_argument("fault", choices=FAULTS)
    parser.add_argument("--seed", type=int, default=0, help="seed of noise and of random losses")
    options = parser.parse_args()
    hand, plant = description(), FaultyPlant(options.seed)
    plant.step(np.zeros(hand.valve_count))  # load the compiled functions first
    rng = np.random.default_rng(options.seed)
    endpoint = FaultySerial(str(options.path), plant, rng)

    state = {"stop": False, "restart": False}

    def begin(_number: int, _frame: FrameType | None) -> None:
        plant.fault = options.fault
        state["restart"] = options.fault == "restarted"

    def end(_number: int, _frame: FrameType | None) -> None:
        plant.fault = ""

    def stop(_number: int, _frame: FrameType | None) -> None:
        state["stop"] = True

    for number, handler in ((signal.SIGUSR1, begin), (signal.SIGUSR2, end)):
        signal.signal(number, handler)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    emulator = Emulator(plant, lambda: endpoint, hand.rate_hz, hand.valve_count)
    print("ready", flush=True)
    begun_s, tick, first = time.monotonic(), 0, 0
    while not state["stop"]:
        tick += 1
        wait_s = begun_s + tick / hand.rate_hz - time.monotonic()
        if wait_s > 0.0:
            time.sleep(wait_s)
        if state["restart"]:
            # A board that restarts forgets its set-points, its host, its clock and its numbers; its adapter stays.
            state["restart"] = False
            endpoint.restart()
            emulator = Emulator(plant, lambda: endpoint, hand.rate_hz, hand.valve_count)
            first = tick - 1
        emulator.tick(tick - first)
    emulator.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
