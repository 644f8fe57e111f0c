"""The start of `hand studio --sim`: from the command to the first angles of the simulated hand, on a built tree.

The CPU time of all its processes is a bound of the time to wait that other programs on the machine hardly change: even
one core does it in that time, apart from ALONE_S of the command, in which a hand that runs already is discovered. The
time to wait itself is given with the load of the machine by other programs, because it means nothing without it.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from hand_client.node import HandClient
from hand_tool.machine_load import LoadMeter
from validation.bench.result import figure

GOAL_S = 8.0
ROUNDS = 5
LONGEST_S = 120.0
NAMESPACE = "started"


def run(quick: bool) -> list[dict[str, Any]]:
    """Medians of ROUNDS starts, after one that fills the caches; quick: one start."""
    starts = [start() for _ in range(1 if quick else ROUNDS + 1)][0 if quick else 1 :]
    cpu_s, wall_s, others = (median(column) for column in zip(*starts, strict=True))
    return [
        figure("studio: CPU of all processes until the first angles", cpu_s, GOAL_S, "s CPU"),
        figure("studio: time until the first angles, under the load of the next line", wall_s, None, "s"),
        figure("studio: load by other programs meanwhile", others, None, "share"),
    ]


def start() -> tuple[float, float, float]:
    """One start: CPU time [s], time to wait [s], and the share of all cores that other programs used."""
    with HandClient(NAMESPACE, "bench") as client, TemporaryDirectory() as folder:
        words = ["studio", "--sim", "--no-browser", "--quiet", "--json", "--namespace", NAMESPACE, "--out", folder]
        meter, begun_s = LoadMeter(), time.monotonic()
        process = subprocess.Popen(
            [sys.executable, "-m", "hand_tool", *words],
            stdout=subprocess.DEVNULL,
            env=os.environ | {"ROS_HOME": folder},
        )
        try:
            came = client.until(lambda: bool(client.state.joints) or process.poll() is not None, LONGEST_S)
            assert came and process.poll() is None, "the studio shows no hand"
            wall_s, cpu_s = time.monotonic() - begun_s, cpu_of(process.pid)
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(timeout=LONGEST_S)
        load = meter.load()
    return cpu_s, wall_s, 0.0 if load is None else load.others


def cpu_of(pid: int) -> float:
    """CPU time [s] so far of a process and of all that descend from it and run."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    own = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    children = " ".join(path.read_text(encoding="utf-8") for path in Path(f"/proc/{pid}/task").glob("*/children"))
    return own + sum(cpu_of(int(child)) for child in children.split())
