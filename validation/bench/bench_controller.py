"""One tick of the controller for 11 joints, from and to message arrays, and eleven updates of simple-pid."""

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
from validation.bench.result import figure

DT_S = 0.005
GOAL = 0.5


def run(quick: bool) -> list[dict[str, Any]]:
    """Both ticks in turn; the ratio is the median of the rounds' ratios."""
    rounds, ticks = (5, 2000) if quick else (25, 20000)
    ours, reference = law_tick(), simple_pid_tick()
    pairs = [(seconds(ours, ticks), seconds(reference, ticks)) for _ in range(rounds)]
    own_us, other_us = (1e6 * median(times) for times in zip(*pairs, strict=True))
    ratio = median(own / other for own, other in pairs)
    return [
        figure("controller tick, 11 joints (reference: eleven updates of simple-pid)", own_us, GOAL, "us", other_us)
        | {"ratio": ratio}
    ]


def law_tick() -> Callable[[], object]:
    """The control law as the controller calls it, from and to the arrays of the messages."""
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
    """The same number of updates of a plain PID with dt given, from and to the same kind of array."""
    pids = [PID(0.15, 1.5, 0.003, setpoint=0.8, output_limits=(0.0, 6e5), sample_time=None) for _ in range(11)]
    position = array("d", [0.5] * len(pids))

    def tick() -> object:
        return array("d", [pid(angle, DT_S) for pid, angle in zip(pids, position, strict=True)])

    return tick


def seconds(tick: Callable[[], object], ticks: int) -> float:
    """Mean time of one tick [s]."""
    begun = time.perf_counter()
    for _ in range(ticks):
        tick()
    return (time.perf_counter() - begun) / ticks
