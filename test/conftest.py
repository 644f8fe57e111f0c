"""All tests: compiled kernels are those of the sources under test; tests in real time run alone.

`make test` runs the tests in several processes (pytest-xdist). A test in real time keeps deadlines, and a process that
is delayed by 0.1 s makes the hand vent. So the processes share a lock: a module of such tests holds it alone, all other
tests hold it together.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

# How long an example takes is the machine's business.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

ROOT = Path(__file__).resolve().parent.parent
_SOURCES = sorted([*ROOT.glob("hand_*/**/*.py"), *ROOT.glob("validation/**/*.py")])
_STAMP = hashlib.sha256(b"".join(path.read_bytes() for path in _SOURCES)).hexdigest()[:16]
# Numba's cache looks at changes of one file alone; a kernel that takes an equation from another could be stale.
# Set before numba is imported, and inherited by every process that a test starts.
os.environ["NUMBA_CACHE_DIR"] = str(ROOT / ".pytest_cache" / f"kernels-{_STAMP}")

REAL_TIME = ("nodes/", "tool/test_demo", "recording/test_recorder_live", "driver/test_emulator.py", "driver/test_can_")
"""Tests of processes that keep deadlines, by the beginning of their path."""
WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
# A domain per test process, before rclpy is imported: nodes of another process must not be heard.
_DOMAIN = int(os.environ.get("ROS_DOMAIN_ID") or os.getpid() % 90 + 10)
os.environ["ROS_DOMAIN_ID"] = str((_DOMAIN - 10 + 17 * WORKER) % 90 + 10)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"


class Lock:
    """Held by one process alone or by several together; who waits for it alone is served before later ones."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._files = [(folder / name).open("w", encoding="utf-8") for name in ("queue.lock", "machine.lock")]
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


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "real_time: keeps deadlines and therefore runs alone (by its path, conftest.py)")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.path.relative_to(ROOT / "test").as_posix().startswith(REAL_TIME):
            item.add_marker(pytest.mark.real_time)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[None]:
    """Hold the lock during a test; a module in real time keeps it, because its fixtures keep processes running."""
    alone = item.get_closest_marker("real_time") is not None
    LOCK.take("alone" if alone else "together")
    try:
        return (yield)
    finally:
        if not (alone and nextitem is not None and nextitem.path == item.path):
            LOCK.release()


def pytest_unconfigure(config: pytest.Config) -> None:
    """Name what failed in the very last lines: logs are often cut to their end."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    for kind in ("failed", "error"):
        for report in reporter.stats.get(kind, []) if reporter else []:
            crash = getattr(report.longrepr, "reprcrash", None)
            message = crash.message.splitlines()[0][:200] if crash and crash.message else ""
            print(f"{kind}: {report.nodeid} {message}")
