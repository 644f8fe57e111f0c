"""All tests: tests in real time run one at a time, and nothing delays them.

`make test` runs the tests in several processes (pytest-xdist). A test in real time keeps deadlines, and a process that
is delayed by 0.1 s makes the hand vent. So the first process runs all of these, and the others take what it leaves of
the machine: the kernel interrupts their scheduling class for any other process that becomes ready (sched(7)). A
separate process measures how long the machine itself stalls; a failed test states it.
"""

from __future__ import annotations

import gc
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest
from hypothesis import settings
from xdist.remote import Producer

from hand_ros.memory import lock_memory
from test.order import Files, in_real_time, turn
from test.repeating import REPEATED

# How long an example takes is the machine's business.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

ROOT = Path(__file__).resolve().parent.parent

WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
# A domain per test process, before rclpy is imported: nodes of another process must not be heard.
_DOMAIN = int(os.environ.get("ROS_DOMAIN_ID") or os.getpid() % 90 + 10)
os.environ["ROS_DOMAIN_ID"] = str((_DOMAIN - 10 + 17 * WORKER) % 90 + 10)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
# Logs and latched faults of nodes under test do not belong to the user.
os.environ["ROS_HOME"] = str(ROOT / ".pytest_cache" / "ros" / str(os.getpid()))


# A shell that starts the tests in the background lets them ignore SIGINT, and so would every process under test.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Files:
    return Files(config, log)


STALL_CODE = """
import os, time
parent = os.getppid()
while os.getppid() == parent:
    begun = time.time()
    time.sleep(0.005)
    late = time.time() - begun - 0.005
    if late > 0.01:
        print(begun, late, flush=True)
"""
"""Sleeps 5 ms at a time and prints when, and by how much [s], it was woken too late."""


class StallWatch:
    """The independent clock of tests in real time: a process that does nothing but measure its own delays."""

    def __init__(self) -> None:
        """Begin to measure."""
        self._stalls: list[tuple[float, float]] = []
        self._process = subprocess.Popen([sys.executable, "-S", "-c", STALL_CODE], stdout=subprocess.PIPE, text=True)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if not line.endswith("\n"):
                return  # the process was ended while it wrote
            begun_s, late_s = line.split()
            self._stalls.append((float(begun_s), float(late_s)))

    def longest_since(self, start_s: float, end_s: float = math.inf) -> float:
        """The longest stall [s] that ended after start_s, and began before end_s [s], of time.time()."""
        ended = ((begun_s, late_s) for begun_s, late_s in self._stalls if begun_s + late_s > start_s)
        return max((late_s for begun_s, late_s in ended if begun_s < end_s), default=0.0)

    def stop(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        self._reader.join()
        if self._process.stdout is not None:
            self._process.stdout.close()


STALL_WATCH: list[StallWatch] = []
"""At most one: started by the first test in real time."""


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "real_time: keeps deadlines, as its path says (test/order.py)")
    if WORKER:
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if in_real_time(item.nodeid):
            item.add_marker(pytest.mark.real_time)
    items.sort(key=lambda item: turn(item.nodeid))


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Measure the stalls of the machine while a test in real time runs."""
    if item.get_closest_marker("real_time") is not None:
        if not STALL_WATCH:
            STALL_WATCH.append(StallWatch())
            lock_memory()  # a client that waits for its own code takes messages for late ones
        item.user_properties.append(("started_s", time.time()))
    REPEATED.clear()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add to a failure in real time how long the machine stalled: more than 0.1 s is a cause of its own."""
    report = yield
    started_s = dict(item.user_properties).get("started_s")
    if report.failed and STALL_WATCH and isinstance(started_s, float):
        stall_s = STALL_WATCH[0].longest_since(started_s)
        line = f"longest stall of the machine during this test: {stall_s:.3f} s (the hand vents after 0.1 s)"
        report.sections.append(("real time", line))
    if report.when == "call":  # properties reach the process that prints, from every test process
        for begun_s, ended_s, why in REPEATED:
            stall_s = STALL_WATCH[0].longest_since(begun_s, ended_s) if STALL_WATCH else 0.0
            report.user_properties.append(("repeated", f"after a stall of {stall_s:.3f} s: {item.nodeid}: {why}"))
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Count and name every repetition of a test: none is silent."""
    reports = [r for kind in ("passed", "failed") for r in terminalreporter.stats.get(kind, []) if r.when == "call"]
    lines = [line for report in reports for name, line in report.user_properties if name == "repeated"]
    if lines:
        terminalreporter.section(f"{len(lines)} repetitions of a test")
        for line in lines:
            terminalreporter.line(f"repeated {line}")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Collect no garbage from before a test in real time: that takes seconds, and messages wait meanwhile."""
    if item.get_closest_marker("real_time") is not None:
        gc.freeze()
    try:
        return (yield)
    finally:
        gc.unfreeze()


def pytest_unconfigure(config: pytest.Config) -> None:
    """Repeat the failures in the last lines: logs are often cut to their end."""
    for watch in STALL_WATCH:
        watch.stop()
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    for kind in ("failed", "error"):
        for report in reporter.stats.get(kind, []) if reporter else []:
            crash = getattr(report.longrepr, "reprcrash", None)
            message = crash.message.splitlines()[0][:200] if crash and crash.message else ""
            print(f"{kind}: {report.nodeid} {message}")
