"""Whether a file of a recording is still being written: by who has it open, and by whether it changes."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path

RECENT_S = 60.0
"""A file that was last changed longer ago is not watched for further changes."""
PROC = Path("/proc")


def user_of(path: Path, proc: Path = PROC) -> int | None:
    """The number of another process that has the file open, as far as this one may see it; None for none."""
    wanted = path.stat()
    for process in proc.iterdir():
        if not process.name.isdigit() or int(process.name) == os.getpid():
            continue
        try:
            opened = list((process / "fd").iterdir())
        except OSError:
            continue  # it has ended, or belongs to another user
        for link in opened:
            try:
                found = link.stat()
            except OSError:
                continue
            if (found.st_dev, found.st_ino) == (wanted.st_dev, wanted.st_ino):
                return int(process.name)
    return None


def changes(paths: Sequence[Path], watch_s: float, sleep: Callable[[float], None] = time.sleep) -> Path | None:
    """The first of the files that changes within watch_s [s]; None for none. Old files are not watched."""
    recent = [path for path in paths if time.time() - path.stat().st_mtime < RECENT_S]
    if not recent or watch_s <= 0.0:
        return None
    before = [(path.stat().st_size, path.stat().st_mtime_ns) for path in recent]
    sleep(watch_s)
    for path, seen in zip(recent, before, strict=True):
        if not path.exists() or (path.stat().st_size, path.stat().st_mtime_ns) != seen:
            return path
    return None
