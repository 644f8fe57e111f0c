"""All tests: compiled kernels belong to the very sources under test."""

from __future__ import annotations

import hashlib
import os
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
"""Tests of processes that keep deadlines: a machine that stalls for 0.1 s makes the hand vent, rightly."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give tests in real time a second and a third chance; what is broken fails three times."""
    for item in items:
        if item.path.relative_to(ROOT / "test").as_posix().startswith(REAL_TIME):
            item.add_marker(pytest.mark.flaky(reruns=2, reruns_delay=1))


def pytest_unconfigure(config: pytest.Config) -> None:
    """Name what failed in the very last lines: logs are often cut to their end."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    for kind in ("failed", "error"):
        for report in reporter.stats.get(kind, []) if reporter else []:
            crash = getattr(report.longrepr, "reprcrash", None)
            message = crash.message.splitlines()[0][:200] if crash and crash.message else ""
            print(f"{kind}: {report.nodeid} {message}")
