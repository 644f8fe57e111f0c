"""The start of `hand studio --sim` on a built tree: from the command to a simulated hand that moves in a browser.

A headless Chromium waits with an empty page and opens the address that the command prints. As soon as the page shows a
hand that is controlled and its picture stays but for the noise, a slider is moved. The time ends when a picture of the
scene differs.
Without a graphics card the pictures are drawn by the processor, with the lowest priority.

The CPU time of all processes of the command up to then is what other programs on the machine hardly change.
"""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib.image import imread

from hand_tool.machine_load import LoadMeter
from validation.bench.result import figure
from validation.browser import Browser, changed

GOAL_S = 8.0
ROUNDS = 5
LONGEST_S = 120.0
NAMESPACE = "started"
SIZE = (700, 560)
"""Of the window [pixels]."""
MOVED, STILL = 0.005, 0.001
"""Share of the pixels of a picture that a finger changes at least, and that the noise of a hand at rest changes."""


def run(quick: bool) -> list[dict[str, Any]]:
    """Medians of ROUNDS starts, after one that fills the caches; quick: one start."""
    with TemporaryDirectory() as folder:
        browser = Browser(Path(folder), "about:blank", SIZE)
        try:
            starts = [start(browser) for _ in range(1 if quick else ROUNDS + 1)][0 if quick else 1 :]
        finally:
            browser.close()
    wall_s, cpu_s, others = (median(column) for column in zip(*starts, strict=True))
    return [
        figure("studio: from the command to the moving hand in the browser", wall_s, GOAL_S, "s"),
        figure("studio: CPU of all processes of the command until then", cpu_s, None, "s CPU"),
        figure("studio: load by other programs meanwhile", others, None, "share"),
    ]


def start(browser: Browser) -> tuple[float, float, float]:
    """One start: time [s] and CPU time [s] until the hand moves, and the share of all cores of other programs."""
    words = ["studio", "--sim", "--no-browser", "--quiet", "--json", "--namespace", NAMESPACE]
    with TemporaryDirectory() as folder:
        meter, drawn_s, begun_s = LoadMeter(), cpu_of(browser.pid), time.monotonic()
        process = subprocess.Popen(
            [sys.executable, "-m", "hand_tool", *words, "--out", folder],
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"ROS_HOME": folder},
        )
        try:
            assert process.stdout is not None
            browser.open(json.loads(process.stdout.readline())["url"])
            move(browser)
            wall_s, cpu_s = time.monotonic() - begun_s, cpu_of(process.pid)
            load = meter.load()
            drawn_s = cpu_of(browser.pid) - drawn_s
        finally:
            browser.open("about:blank")
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=LONGEST_S)  # closes the pipe
    if load is None:
        return wall_s, cpu_s, 0.0
    return wall_s, cpu_s, max(load.others - (cpu_s + drawn_s) / (load.cores * wall_s), 0.0)


def move(browser: Browser) -> None:
    """Move a finger by the page until its picture changes."""
    control(browser)
    before, now = b"", browser.scene()
    while not before or np.ptp(imread(io.BytesIO(now))) < 0.1 or changed(before, now) > STILL:
        before, now = now, browser.scene()
    browser.press("index_proximal", "End")
    end = time.monotonic() + LONGEST_S
    while changed(now, browser.scene()) < MOVED:
        assert time.monotonic() < end, f"the hand does not move: {browser.text()}"
        if control(browser):
            browser.press("index_proximal", "Home")
            browser.press("index_proximal", "End")


def control(browser: Browser) -> bool:
    """Wait until the hand is controlled; whether it had to be enabled, because a machine that stalls vents it."""
    end, enabled = time.monotonic() + LONGEST_S, False
    while (safety := str(browser.run("document.querySelector('#safety')?.innerText ?? ''"))) != "controlling":
        assert time.monotonic() < end, f"the hand is not controlled: {browser.text()}"
        if safety.startswith("vented"):
            browser.click("Enable")
            enabled = True
        time.sleep(1.5 if enabled else 0.05)
    return enabled


def cpu_of(pid: int) -> float:
    """CPU time [s] so far of a process and of all that descend from it and run."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    own = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    children = " ".join(path.read_text(encoding="utf-8") for path in Path(f"/proc/{pid}/task").glob("*/children"))
    return own + sum(cpu_of(int(child)) for child in children.split())
