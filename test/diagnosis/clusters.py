"""A dask cluster of this machine, scheduler and worker as processes of their own."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

GRACE_S = 10.0  # a process that has not ended after this time is killed: what it computed has arrived


@contextmanager
def cluster(folder: Path, *options: str, workers: int = 1, scheme: str = "tcp") -> Iterator[str]:
    """The address of a scheduler with workers of one thread each, both started with these options in `folder`."""
    port = str(20000 + time.monotonic_ns() % 20000)
    address = f"{scheme}://127.0.0.1:{port}"
    given = [*options, "--no-dashboard"]
    processes = ["--nthreads", "1", *(["--nworkers", str(workers)] if workers > 1 else ["--no-nanny"])]
    commands = (
        ["distributed.cli.dask_scheduler", "--host", f"{scheme}://127.0.0.1", "--port", port, *given],
        ["distributed.cli.dask_worker", address, *processes, *given],
    )
    running: list[subprocess.Popen[bytes]] = []
    try:
        for command in commands:
            start = [sys.executable, "-m", *command]
            running.append(subprocess.Popen(start, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=folder))
        yield address
    finally:
        for process in reversed(running):
            _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(timeout=GRACE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
