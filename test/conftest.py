"""All tests: tests in real time run alone.

`make test` runs the tests in several processes (pytest-xdist). A test in real time keeps deadlines, and a process that
is delayed by 0.1 s makes the hand vent. So one process runs all of these at the end, and the processes share a lock:
tests in real time hold it alone, all other tests hold it together. A separate process measures how long the machine
itself stalls; a failed test states it.
"""

from __future__ import annotations

import fcntl
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
from xdist.scheduler import LoadScopeScheduling

from hand_ros.memory import lock_memory
from test.repeating import REPEATED

# How long an example takes is the machine's business.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

ROOT = Path(__file__).resolve().parent.parent

REAL_TIME = (
    "nodes/",
    "tool/test_demo",
    "recording/test_recorder_live",
    "driver/test_emulator.py",
    "driver/test_can_",
    "driver/test_c_board",
)
"""Tests of processes that keep deadlines, by the beginning of their path below test/."""
FIRST = ("validation/", "diagnosis/")
"""Where the longest tests are: at the end they would run while the other processes have nothing left."""
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


def in_real_time(nodeid: str) -> bool:
    """Whether a test keeps deadlines, by its path."""
    return nodeid.removeprefix("test/").startswith(REAL_TIME)


class Files(LoadScopeScheduling):
    """Gives whole files to test processes, in their order; all tests in real time, the last ones, to one of them."""

    def __init__(self, config: pytest.Config, log: Producer | None = None) -> None:
        """Begin without tests."""
        super().__init__(config, log)
        config.option.loadscopereorder = False  # the file with most tests is not the longest

    def _split_scope(self, nodeid: str) -> str:
        return "real time" if in_real_time(nodeid) else nodeid.split("::", maxsplit=1)[0]


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Files:
    return Files(config, log)


class Lock:
    """Held by one process alone or by several together; who waits for it alone is served before later ones."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        flags = os.O_RDWR | os.O_CREAT
        self._files = [os.open(folder / name, flags) for name in ("queue.lock", "machine.lock")]
        self._held = ""

    def take(self, how: str) -> None:
        """Wait until it is held in this way: "alone" or "together"."""
        if self._held == how:
            return
        self.release()
        queue, machine = self._files
        fcntl.flock(queue, fcntl.LOCK_EX)
        fcntl.flock(machine, fcntl.LOCK_EX if how == "alone" else fcntl.LOCK_SH)
        fcntl.flock(queue, fcntl.LOCK_UN)
        self._held = how

    def release(self) -> None:
        if self._held:
            fcntl.flock(self._files[1], fcntl.LOCK_UN)
            self._held = ""


LOCK = Lock(ROOT / ".pytest_cache")
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
    config.addinivalue_line("markers", "real_time: keeps deadlines and therefore runs alone (by its path, conftest.py)")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if in_real_time(item.nodeid):
            item.add_marker(pytest.mark.real_time)
    items.sort(key=lambda item: (in_real_time(item.nodeid), not item.nodeid.removeprefix("test/").startswith(FIRST)))


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
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[None]:
    """Hold the lock during a test; tests in real time keep it, because their fixtures keep processes running."""
    alone = item.get_closest_marker("real_time") is not None
    LOCK.take("alone" if alone else "together")
    if alone:  # a collection takes seconds in a process that has run thousands of tests, and messages wait meanwhile
        gc.freeze()
    try:
        return (yield)
    finally:
        gc.unfreeze()
        if not (alone and nextitem is not None and nextitem.get_closest_marker("real_time") is not None):
            LOCK.release()


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
