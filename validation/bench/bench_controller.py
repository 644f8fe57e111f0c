"""One tick of the law for 11 joints from and to message arrays, eleven updates of simple-pid, and cost of monitors."""

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
from validation.faults.sensor_loop import Loop, Plant

DT_S = 0.005
GOAL = 0.5
MONITOR_GOAL_PERCENT = 15.0
SEED = 20261123


def run(quick: bool) -> list[dict[str, Any]]:
    """Both ticks in turn; the ratio is the median of the rounds' ratios."""
    rounds, ticks = (5, 2000) if quick else (25, 20000)
    ours, reference = law_tick(), simple_pid_tick()
    pairs = [(seconds(ours, ticks), seconds(reference, ticks)) for _ in range(rounds)]
    own_us, other_us = (1e6 * median(times) for times in zip(*pairs, strict=True))
    ratio = median(own / other for own, other in pairs)
    return [
        figure("controller tick, 11 joints (reference: eleven updates of simple-pid)", own_us, GOAL, "us", other_us)
        | {"ratio": ratio},
        figure(
            "monitors of sensors and pressures: share of a frame of the controller",
            100.0 * monitor_share(ticks // 4, rounds),
            MONITOR_GOAL_PERCENT,
            "%",
        ),
    ]


def monitor_share(frames: int, rounds: int) -> float:
    """Median over rounds of the share of `Controller.frame` that the checks of a frame take, in one run [-]."""
    hand = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
    loop, share = Loop(hand, Plant(), SEED), []
    loop.controller.enable(True)
    loop.step()
    loop.command(np.full(len(hand.joints), 0.8))
    controller, clock = loop.controller, time.perf_counter
    spent = {"frame": 0.0, "monitors": 0.0}

    def timed(owner: object, name: str, key: str) -> None:
        inner = getattr(owner, name)

        def call(*arguments: object) -> object:
            begun = clock()
            result = inner(*arguments)
            spent[key] += clock() - begun
            return result

        setattr(owner, name, call)

    timed(controller, "frame", "frame")
    timed(controller, "_check_measurement", "monitors")
    timed(controller._watch, "hold", "monitors")
    for _ in range(rounds):
        spent["frame"] = spent["monitors"] = 0.0
        for _ in range(frames):
            loop.step()
        share.append(spent["monitors"] / spent["frame"])
    return median(share)


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
