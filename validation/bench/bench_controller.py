"""One tick of the law for 11 joints from and to message arrays, eleven updates of simple-pid, and cost of monitors."""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from simple_pid import PID

from hand_control.controller import Controller
from hand_control.declared import OUT, Settings, U
from hand_control.frame_watch import NOTHING
from hand_control.law import Law
from hand_control.supervisor import Supervisor
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
    monitors_s, share = monitor_cost(ticks // 50, rounds)
    return [
        figure("controller tick, 11 joints (reference: eleven updates of simple-pid)", own_us, GOAL, "us", other_us)
        | {"ratio": ratio},
        figure("safety monitors: sensors, pressures, gaps, silence", 1e6 * monitors_s, None, "us"),
        figure("safety monitors: share of a frame", 100.0 * share, MONITOR_GOAL_PERCENT, "%"),
    ]


def monitor_cost(frames: int, rounds: int) -> tuple[float, float]:
    """Time [s] of a frame that the safety monitors of the controller take, and its share of the frame [-].

    In turn with every monitor and with none: a clock around each of them would cost as much as the smallest one.
    """
    hand = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
    loop = Loop(hand, Plant(), SEED)
    loop.controller.enable(True)
    loop.step()
    loop.command(np.full(len(hand.joints), 0.8))
    spent = timed(loop.controller, "frame")
    taken, share = [], []
    for _ in range(rounds):
        frame_s = frame_time(loop, frames, spent)
        with without_monitors(loop.controller):
            taken.append(frame_s - frame_time(loop, frames, spent))
        share.append(taken[-1] / frame_s)
    return median(taken), median(share)


@contextmanager
def without_monitors(controller: Controller) -> Iterator[None]:
    """A controller that drives on whatever it measures: what a monitor reports is that nothing is wrong."""
    replaced: list[tuple[object, str, object]] = [
        (controller._watch, "check", NOTHING),
        (controller._watch, "hold", None),
        (controller._gap, "before", False),
        (Supervisor, "frame", True),
        (Supervisor, "check", None),
        (Supervisor, "command_held", False),
    ]
    kept = [vars(owner).get(name) for owner, name, _ in replaced]
    for owner, name, answer in replaced:
        setattr(owner, name, partial(_answer, answer))
    try:
        yield
    finally:
        for (owner, name, _), before in zip(replaced, kept, strict=True):
            setattr(owner, name, before) if before else delattr(owner, name)


def _answer(answer: object, *_: object) -> object:
    return answer


def timed(owner: object, name: str) -> list[float]:
    """The times [s] that calls of a method of the owner will take, in this list."""
    inner, clock, spent = getattr(owner, name), time.perf_counter, list[float]()

    def call(*arguments: object) -> object:
        begun = clock()
        result = inner(*arguments)
        spent.append(clock() - begun)
        return result

    setattr(owner, name, call)
    return spent


def frame_time(loop: Loop, frames: int, spent: list[float]) -> float:
    """Lower quartile of the times in `spent` [s] over some frames: other programs run in some of them."""
    spent.clear()
    for _ in range(frames):
        loop.step()
    return float(np.quantile(spent, 0.25))


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
