"""Workers of a pool do not outlive the process that started them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ABANDON = """
import os, sys, time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from validation.trial.workers import end_with_parent

if __name__ == "__main__":
    pool = ProcessPoolExecutor(2, get_context(sys.argv[1]), end_with_parent)
    if sys.argv[2] == "busy":
        print(sum(pool.map(abs, [1, 1])), flush=True)
    waiting = [pool.submit(time.sleep, 600.0) for _ in range(2)]
    os._exit(0)
"""


@pytest.mark.parametrize("state", ["busy", "beginning"])
@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_workers_end_with_their_parent(method: str, state: str, tmp_path: Path) -> None:
    """Fails when a worker that is busy, or that begins as its parent ends, lives on and keeps the terminal."""
    script = tmp_path / "abandon.py"
    script.write_text(ABANDON, encoding="utf-8")
    done = subprocess.run([sys.executable, script, method, state], capture_output=True, timeout=60, check=False)
    assert done.returncode == 0
