"""Worker processes that end with the process that started them, whenever it ends."""

from __future__ import annotations

import os
import threading
from multiprocessing import parent_process
from multiprocessing.connection import wait


def end_with_parent() -> None:
    """Initializer of a pool: end this worker when its parent is gone, even where that happened before it began.

    A worker that starts while its parent is being interrupted would otherwise wait for work, or finish it, alone.
    """
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_end_after, args=(parent.sentinel,), daemon=True, name="parent").start()


def _end_after(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)
