"""Spikes: readings that jump away and come back within a few samples, in a signal that is otherwise smooth.

A jump as large as several steps of the motion is a spike of any signal. A position is continuous with its speed, so a
smaller one shows, too: it misses the lines through the readings before it and through those behind it, on the same
side, by many times what readings usually miss them. A turn of the motion misses neither line.
"""

from __future__ import annotations

import numpy as np

from hand_machine.settings import MACHINE
from hand_model.arrays import Array, Flags

NEIGHBOURS = 5
"""Readings from which one can be compared with the lines before and behind it."""


def find_spikes(values: Array, *, pulses: bool = False) -> Flags:
    """Which finite readings (n,) [any unit] jump away and back within longest_spike. pulses: small ones are real."""
    low, high = np.quantile(values, [MACHINE.range_quantile, 1.0 - MACHINE.range_quantile])
    steps = np.diff(values)
    least = MACHINE.input_spike_range * (high - low)
    if not pulses:
        least = max(
            MACHINE.spike_steps * float(np.quantile(np.abs(steps), MACHINE.spike_step_quantile)),
            MACHINE.spike_range * (high - low),
        )
    found = np.zeros(len(values), dtype=bool)
    if least == 0.0:
        return found
    for start in (np.flatnonzero(np.abs(steps) > least) + 1).tolist():
        before = values[start - 1]
        if found[start - 1]:
            continue
        for end in range(start + 1, min(start + MACHINE.longest_spike, len(values) - 1) + 1):
            away = values[start:end] - before
            returned = abs(values[end] - before) < MACHINE.spike_return_share * float(np.abs(away).min())
            if returned and float(np.abs(away).min()) > least and len(set(np.sign(away))) == 1:
                found[start:end] = True
                break
    return found


def find_off_the_motion(times: Array, values: Array) -> Flags:
    """Which finite positions (n,) [any unit] miss the motion before and behind them. times: (n,) rising."""
    found = find_spikes(values)
    for _ in range(MACHINE.spike_passes):
        kept = np.flatnonzero(~found)
        if len(kept) < NEIGHBOURS:
            return found
        missed, typical = _missed(times[kept], values[kept])
        low, high = np.quantile(values[kept], [MACHINE.range_quantile, 1.0 - MACHINE.range_quantile])
        if typical > MACHINE.well_sampled * float(high - low):
            return found
        steps = np.abs(np.diff(values[kept]))
        resolution = float(steps[steps > 0.0].min(initial=np.inf)) if (steps > 0.0).any() else 0.0
        usual = float(np.quantile(missed, MACHINE.miss_quantile))
        least = max(
            MACHINE.misses * usual, MACHINE.resolution_steps * resolution, MACHINE.miss_range * float(high - low)
        )
        far = missed > least
        # Next to a spike, the lines are wrong, too: of neighbours only the one that misses most is taken.
        nearby = np.maximum(np.r_[0.0, missed[:-1]], np.r_[missed[1:], 0.0])
        taken = kept[far & (missed >= nearby)]
        if not len(taken):
            return found
        found[taken] = True
    return found


def _missed(times: Array, values: Array) -> tuple[Array, float]:
    """By how much readings (n,) miss the lines before, behind and through their neighbours, where on the same side.

    Second, the median miss of the line before.
    """
    missed = np.zeros(len(values))
    t, x = times, values
    with np.errstate(divide="ignore", invalid="ignore"):
        before = x[1:-3] + (x[1:-3] - x[:-4]) * (t[2:-2] - t[1:-3]) / (t[1:-3] - t[:-4])
        behind = x[3:-1] + (x[3:-1] - x[4:]) * (t[2:-2] - t[3:-1]) / (t[3:-1] - t[4:])
        between = x[1:-3] + (x[3:-1] - x[1:-3]) * (t[2:-2] - t[1:-3]) / (t[3:-1] - t[1:-3])
    by = np.array([x[2:-2] - line for line in (before, behind, between)])
    alike = np.abs(np.sign(by).sum(axis=0)) == len(by)
    missed[2:-2] = np.where(alike, np.abs(by).min(axis=0), 0.0)
    return missed, float(np.median(np.abs(by[0])))
