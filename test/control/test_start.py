"""The start of the controller: what was compiled once is loaded by the next process."""

from __future__ import annotations

import json
import subprocess
import sys

FIRST_TICK = """
import json
import numpy as np
from hand_control.declared import GAINS
from hand_control.law import Law, _tick
law = Law(np.ones((len(GAINS), 3)))
law.tick(law.inputs, 0.005)
print(json.dumps([sum(_tick.stats.cache_hits.values()), sum(_tick.stats.cache_misses.values())]))
"""


def first_tick() -> tuple[int, int]:
    """How many compiled functions the first tick of a new process loads, and how many it compiles."""
    done = subprocess.run([sys.executable, "-c", FIRST_TICK], capture_output=True, text=True, check=True)
    hits, misses = json.loads(done.stdout)
    return hits, misses


def test_the_law_is_compiled_once_on_a_machine() -> None:
    """Fails when each process compiles the law again, seconds at every start: its cache is then never found."""
    first_tick()
    assert first_tick() == (1, 0)
