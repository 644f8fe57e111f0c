"""Readings that are only repeated: a sensor that is read less often than its value is written down.

Between two values of the sensor the table has the last one again, so that a moving axis seems to go by steps. Of such a
column only the rows count at which the value changes. A coarse encoder also repeats its readings, but goes on by single
steps; one that goes on by several at once was not read in between.
"""

from __future__ import annotations

import numpy as np

from hand_machine.settings import MACHINE
from hand_model.arrays import Array, Flags


def find_repeats(values: Array) -> tuple[Flags, float]:
    """Which finite readings (n,) only repeat the one before, and how many rows the signal is held for; 1: it is not."""
    none = np.zeros(len(values), dtype=bool)
    steps = np.abs(np.diff(values))
    moving = steps[steps > 0.0]
    if not len(moving) or 1.0 - len(moving) / len(steps) < MACHINE.least_repeated:
        return none, 1.0
    resolution = float(np.diff(np.unique(values)).min())
    if float(np.median(moving)) < MACHINE.least_held_steps * resolution:
        return none, 1.0
    changes = np.flatnonzero(np.r_[True, steps > 0.0])
    lengths = np.diff(np.r_[changes, len(values)])
    held = float(np.median(lengths))
    if held < 2.0:
        return none, 1.0
    run = np.repeat(np.arange(len(changes)), lengths)
    repeats = np.arange(len(values)) > changes[run]
    return repeats & (lengths[run] <= MACHINE.most_held * held), held
