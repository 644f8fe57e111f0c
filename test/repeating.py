"""Repeat a test in which a stall of the machine alone has vented the hand; the last lines of pytest name each time."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from typing import Any

TRIES = 3
STALLED = ("no usable sensor data", "the board reports that it is vented, although", "no measurement for")
"""Reasons for which a hand vents where its processes do not run for 0.1 s."""
REPEATED: list[tuple[float, float, str]] = []
"""Of the running test: begin and end [s] of time.time() of each try that did not count, and why the hand vented."""


def again_after_a_stall(test: Callable[..., None]) -> Callable[..., None]:
    """Repeat a test at most twice where a fixture's `vented_by_a_stall` gives a line; any other failure counts.

    Every fixture of the test has `begin_again`, which is called before the test is repeated.
    """

    @functools.wraps(test)
    def run(**fixtures: Any) -> None:
        for tries_left in reversed(range(TRIES)):
            begun_s = time.time()
            try:
                return test(**fixtures)
            except AssertionError:
                found = [each.vented_by_a_stall() for each in fixtures.values() if hasattr(each, "vented_by_a_stall")]
                if not (tries_left and any(found)):
                    raise
                REPEATED.append((begun_s, time.time(), next(filter(None, found))))
                for fixture in fixtures.values():
                    fixture.begin_again()
        return None

    return run
