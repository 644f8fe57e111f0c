"""Wait for what another process or thread does."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any


def until(condition: Callable[[], Any], timeout_s: float = 10.0) -> None:
    """Wait for a condition, looking every 20 ms; fails after timeout_s [s]."""
    end = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end, f"condition not met in {timeout_s:g} s"
        time.sleep(0.02)
