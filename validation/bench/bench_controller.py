"""The controller's tick for 11 joints, message arrays in and out, beside eleven simple-pid updates."""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from simple_pid import PID

from hand_control.declared import OUT, Settings, U
from hand_control.law import Law
from hand_control.tuning import gains
from hand_model.description import load_hand

DT_S = 0.005
GOAL = 0.5


def run(quick: bool) -> list[dict[str, Any]]:
    rounds, ticks = (5, 2000) if quick else (25, 20000)
    ours, reference = law_tick(), simple_pid_tick()
    pairs = [(seconds(ours, ticks), seconds(reference, ticks)) for _ in range(rounds)]
    return [
        {
            "name": "controller tick, 11 joints, arrays converted / eleven simple-pid updates",
            "ours": median(a for a, _ in pairs) * 1e6,
            "reference": median(b for _, b in pairs) * 1e6,
            "ratio": median(a / b for a, b in pairs),
            "goal": GOAL,
            "unit": "us",
        }
    ]


def law_tick() -> Callable[[], object]:
    """The law as the controller calls it, from and to the arrays that messages hold."""
    hand = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
    settings = Settings.of(hand, {})
    law = Law(gains(hand, settings))
    count = len(hand.joints)
    reference, speed = np.full(count, 0.8), np.zeros(count)
    limit = hand.limits.max_torque_nm
    position, pressure = (array("d", [value] * count) for value in (0.5, 1e5))
    inputs = law.inputs

    def tick() -> object:
        inputs[U.reference], inputs[U.speed], inputs[U.acceleration] = reference, speed, speed
        inputs[U.limit] = limit
        inputs[U.position], inputs[U.pressure] = np.frombuffer(position), np.frombuffer(pressure)
        command = array("d")
        command.frombytes(law.tick(inputs, DT_S)[OUT.pressure].tobytes())
        return command

    return tick


def simple_pid_tick() -> Callable[[], object]:
    """The same number of updates of a plain PID, dt given, from and to the same kind of array."""
    pids = [PID(0.15, 1.5, 0.003, setpoint=0.8, output_limits=(0.0, 6e5), sample_time=None) for _ in range(11)]
    position = array("d", [0.5] * len(pids))

    def tick() -> object:
        return array("d", [pid(angle, DT_S) for pid, angle in zip(pids, position, strict=True)])

    return tick


def seconds(tick: Callable[[], object], ticks: int) -> float:
    """Time of one tick [s], averaged over many."""
    begun = time.perf_counter()
    for _ in range(ticks):
        tick()
    return (time.perf_counter() - begun) / ticks
