"""The control loop over DDS between processes: missed periods, latency, and the round trip compared with plain rclpy.

Latency is the time from the acquisition stamp of a frame to the source timestamp of its valve command, both on this
host. A period is missed if no command answers its frame, or if the command is published after the next frame is due.
The round trip is the time from the source timestamp of joint_states to that of the valve command that answers it. The
plain pair stamps a frame when its timer wakes and the driver at the tick of the board, so acquisition stamps of the two
are not comparable.

HAND_FORMER=folder: the built tree of another version of this project, run in turn with this one at 200 Hz and 1 kHz.
The result is the median of the pairs' ratios, since latencies of two days or of two machines are not comparable.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np
import rclpy
from ament_index_python.packages import get_package_prefix, get_package_share_directory
from hand_msgs.msg import ValveCommand
from sensor_msgs.msg import JointState

from validation.bench.result import figure

WARM_UP_S, QUICK_WARM_UP_S = 3.0, 0.5
DEPTH = 1000
START_S = 120.0
"""Longest time for two processes to start, to compile and to find each other."""
TAKE_PERIOD_S = 0.05
ROUND_TRIP_HZ = 200
GOALS = ((200, 0.01), (500, 0.03), (1000, 0.05))
"""Rates [Hz] with the largest share of missed periods."""
FORMER = "HAND_FORMER"
"""Environment variable with the folder of the other version."""
FORMER_HZ = (200, 1000)
FORMER_GOAL = 1.1


class Length(NamedTuple):
    """Measured seconds, seconds before them, and number of runs."""

    seconds: float
    warm_up_s: float
    rounds: int


@dataclass
class Run:
    """One run: latency and round trip [s] of all answers, share of missed periods, CPU of both processes [cores]."""

    latency_s: np.ndarray[Any, np.dtype[np.float64]]
    answer_s: np.ndarray[Any, np.dtype[np.float64]]
    missed: float
    cpu: float


def run(quick: bool) -> list[dict[str, Any]]:
    """Medians of five runs of 10 s at each rate; quick: one run of 1 s at 200 Hz."""
    length = Length(1.0, QUICK_WARM_UP_S, 1) if quick else Length(10.0, WARM_UP_S, 5)
    rates = GOALS[:1] if quick else GOALS
    context = rclpy.Context()
    rclpy.init(context=context)
    try:
        results = []
        for rate_hz, goal in rates:
            runs = [measure(context, stack(rate_hz), rate_hz, length) for _ in range(length.rounds)]
            results += loop_results(rate_hz, goal, runs)
        if FORMER in os.environ:
            results += former_latency(context, Path(os.environ[FORMER]).resolve(), length)
        return results + round_trip(context, length)
    finally:
        context.try_shutdown()


def loop_results(rate_hz: int, goal: float, runs: list[Run]) -> list[dict[str, Any]]:
    """Results of the runs at one rate; goal: largest share of missed periods [-]."""
    p50, p99 = (median(float(np.percentile(r.latency_s, q)) * 1e3 for r in runs) for q in (50, 99))
    figures = [
        (f"loop {rate_hz} Hz missed periods", median(r.missed for r in runs), goal, "fraction"),
        (f"loop {rate_hz} Hz latency p50", p50, 3.0 if rate_hz == ROUND_TRIP_HZ else None, "ms"),
        (f"loop {rate_hz} Hz latency p99", p99, 10.0 if rate_hz == ROUND_TRIP_HZ else None, "ms"),
        (f"loop {rate_hz} Hz CPU", median(r.cpu for r in runs), None, "cores"),
    ]
    return [figure(*arguments) for arguments in figures]


def round_trip(context: Any, length: Length) -> list[dict[str, Any]]:
    """This stack and plain rclpy in turn, compared pair by pair."""
    pairs = [
        (
            measure(context, stack(ROUND_TRIP_HZ), ROUND_TRIP_HZ, length),
            measure(context, plain(ROUND_TRIP_HZ), ROUND_TRIP_HZ, length),
        )
        for _ in range(length.rounds)
    ]
    p50 = [(median(a.answer_s) * 1e3, median(b.answer_s) * 1e3) for a, b in pairs]
    cpu = [(a.cpu, b.cpu) for a, b in pairs]
    return [
        figure(name, median(own for own, _ in values), goal, unit, median(other for _, other in values))
        | {"ratio": median(own / other for own, other in values)}
        for name, values, goal, unit in (
            ("round trip p50 (reference: plain rclpy)", p50, 0.7, "ms"),
            ("round trip CPU (reference: plain rclpy)", cpu, 0.5, "cores"),
        )
    ]


def former_latency(context: Any, tree: Path, length: Length) -> list[dict[str, Any]]:
    """Latency of this version and of the one in another tree, in turn. ValueError where that tree is not built."""
    if not (tree / "install" / "setup.bash").is_file():
        raise ValueError(f"{FORMER} is {tree}; it must be a tree of this project after make build")
    results = []
    for rate_hz in FORMER_HZ:
        # The other version gets its own description of the hand: this one's may have keys that it does not know.
        former = [["bash", "-c", f'unset PYTHONPATH; source {tree}/env.bash; exec "$@"', "former", *command]
                  for command in stack(rate_hz, tree / "install" / "fluidic_hand")]  # fmt: skip
        pairs = [
            (measure(context, stack(rate_hz), rate_hz, length), measure(context, former, rate_hz, length))
            for _ in range(length.rounds)
        ]
        for share in (50, 99):
            values = [tuple(1e3 * float(np.percentile(run.latency_s, share)) for run in pair) for pair in pairs]
            ours, theirs = (median(column) for column in zip(*values, strict=True))
            name = f"loop {rate_hz} Hz latency p{share} (reference: former version)"
            goal = FORMER_GOAL if share == 50 else None  # the tail of seconds is that of the machine
            ratio = median(own / other for own, other in values)
            results.append(figure(name, ours, goal, "ms", theirs) | {"ratio": ratio})
    return results


def stack(rate_hz: int, prefix: Path | None = None) -> list[list[str]]:
    """Command lines of the simulation and the controller at a frame rate [Hz]; prefix: of another installation."""
    folder = (prefix or Path(get_package_prefix("fluidic_hand"))) / "lib" / "fluidic_hand"
    share = prefix / "share" / "fluidic_hand" if prefix else Path(get_package_share_directory("fluidic_hand"))
    config = share / "config"
    version = "former" if prefix else "this"
    hand = Path(tempfile.gettempdir()) / f"hand_bench_{os.getpid()}_{version}_{rate_hz}.yaml"
    text = (config / "hand.yaml").read_text(encoding="utf-8")
    hand.write_text(text.replace("rate_hz: 200", f"rate_hz: {rate_hz}"), encoding="utf-8")
    drive = [
        "--params-file",
        str(config / "controller.yaml"),
        *_use(hand, "controller"),
        "-p",
        "enabled_at_start:=true",
    ]
    return [
        [str(folder / "simulation"), "--ros-args", *_use(hand, "simulation")],
        [str(folder / "controller"), "--ros-args", *drive],
    ]


def _use(hand: Path, node: str) -> list[str]:
    """Parameters of a node: the hand, and a file of its own for a latched fault, which an earlier run may have left."""
    state = hand.with_suffix(f".{node}.json")
    state.unlink(missing_ok=True)
    return ["-p", f"hand_description:={hand}", "-p", f"state_file:={state}"]


def plain(rate_hz: int) -> list[list[str]]:
    """Command lines of the reference pair."""
    module = [sys.executable, "-m", "validation.bench.loop_reference"]
    return [[*module, "sensor", str(rate_hz)], [*module, "control"]]


@contextmanager
def processes(commands: list[list[str]]) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Processes of the commands, ended on leaving."""
    started = [subprocess.Popen(command, stderr=subprocess.DEVNULL) for command in commands]
    try:
        yield started
    finally:
        for process in started:
            process.send_signal(signal.SIGINT)
        for process in started:
            try:
                process.wait(timeout=5)
            except subprocess.TimeoutExpired:  # a plain spin can miss its signal
                process.kill()
                process.wait()


def measure(context: Any, commands: list[list[str]], rate_hz: float, length: Length) -> Run:
    """Run two processes and measure after their discovery and the warm-up. TimeoutError where they do not connect."""
    node = rclpy.create_node("loop_probe", namespace="hand", context=context)
    probe = node.create_subscription(ValveCommand, "valve_command", lambda _: None, DEPTH, raw=True)
    asked = node.create_subscription(JointState, "joint_states", lambda _: None, DEPTH, raw=True)
    try:
        with processes(commands) as started:
            _take([probe, asked], START_S, enough=round(rate_hz * length.warm_up_s))
            begun, cpu = time.monotonic(), sum(map(_cpu_s, started))
            seen, frames = _take([probe, asked], length.seconds)
            used = (sum(map(_cpu_s, started)) - cpu) / (time.monotonic() - begun)
    finally:
        node.destroy_node()
    stamps, sent = np.array(seen).T
    latency_s = (sent - stamps) * 1e-9
    periods = round((stamps[-1] - stamps[0]) * 1e-9 * rate_hz) + 1
    in_time = len(np.unique(stamps[latency_s <= 1.0 / rate_hz]))
    published = dict(frames)
    answer_s = np.array([(at - published[stamp]) * 1e-9 for stamp, at in seen if stamp in published])
    return Run(latency_s, answer_s, max(0.0, 1.0 - in_time / periods), used)


def _take(probes: list[Any], seconds: float, enough: int | None = None) -> list[list[tuple[int, int]]]:
    """Acquisition stamp and source timestamp [ns] of each probe's messages, for some seconds or until enough came.

    The probes are emptied in batches and without an executor, so that the measurement uses little of the two cores.
    """
    seen: list[list[tuple[int, int]]] = [[] for _ in probes]
    end = time.monotonic() + seconds
    while time.monotonic() < end and (enough is None or min(map(len, seen)) < enough):
        time.sleep(TAKE_PERIOD_S)
        for probe, into in zip(probes, seen, strict=True):
            with probe.handle:
                while (taken := probe.handle.take_message(probe.msg_type, True)) is not None:
                    sec, nanosec = np.frombuffer(taken[0], "<u4", 2, 4).tolist()
                    into.append((sec * 1_000_000_000 + nanosec, taken[1]["source_timestamp"]))
    if min(map(len, seen)) < (enough or 2):
        raise TimeoutError("the two processes exchanged no messages: are the packages built and sourced?")
    return seen


def _cpu_s(process: subprocess.Popen[bytes]) -> float:
    fields = Path(f"/proc/{process.pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
