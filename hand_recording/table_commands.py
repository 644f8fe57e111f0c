"""When the set-points of a table came into force: at the stamps of its rows, or at the ticks of a steady clock.

A row says which set-point is in force, and its stamp when its readings were taken. Where rows are stamped at uneven
times, the set-point may still have been sent by a steady clock. The measured pressures decide which of the two they
follow; where they do not, the stamp counts.

A row that is missing takes its set-point with it. A straight line between its neighbours replaces it; where they differ
by more than their slopes say, a step was lost with it, and the readings until the pressure has settled are left out.
"""

from __future__ import annotations

import math

import numpy as np

from hand_model.arrays import Array, Flags
from hand_recording.interpolation import in_force, longest_gap_s
from hand_recording.sample_clock import TableClock
from hand_recording.settings import READING

ROUNDING = 1e-3
"""Part of a period by which a time may miss its tick because it was rounded."""
CHANCE = 3.0
"""Difference of two errors, in units of the scatter of one over the square root of the samples, beyond chance."""


def set_points_between(clock: TableClock, sent_pa: Array, pressure_pa: Array) -> tuple[Array, int, Flags]:
    """Set-points in force (parts (T - 1) + 1, J) [Pa], the number of parts of each sample, and readings to leave out.

    sent_pa: (N, J) of the rows; NaN where none is given.  pressure_pa: (T, J) measured, on the grid of the clock; NaN
    where there is none.  The last result are flags (T, J) of readings after a step that was lost.
    """
    grid, period_s = clock.grid_s, float(clock.grid_s[1] - clock.grid_s[0])
    rows, added, lost = _bridged(clock.tick_s, sent_pa, period_s)
    own_s, tick_s = (np.interp(rows, np.arange(len(each)), each) for each in (clock.time_s, clock.tick_s))
    unknown = np.zeros((len(grid), sent_pa.shape[1]), dtype=bool)
    for row, joint in lost:
        since = grid - clock.time_s[row + 1]
        unknown[(since > clock.time_s[row] - clock.time_s[row + 1]) & (since < READING.lost_step_s), joint] = True
    if _is_on(grid, clock.time_s):
        return _held(grid, own_s, added), 1, unknown
    parts = max(math.ceil(period_s / READING.part_s), 1)
    fine = grid[0] + period_s / parts * np.arange(parts * (len(grid) - 1) + 1)
    own = _held(fine, own_s, added)
    if _is_on(grid, clock.tick_s):
        ticked = _held(grid, tick_s, added)
        clearly = 1.0 - CHANCE / math.sqrt(len(grid))
        if _error(ticked, 1, pressure_pa) < clearly * _error(own, parts, pressure_pa):
            return ticked, 1, unknown
    return own, parts, unknown


def _bridged(time_s: Array, sent_pa: Array, period_s: float) -> tuple[Array, Array, list[tuple[int, int]]]:
    """Places (M,) and set-points (M, J) of all rows and of those that are missing between them, and the lost steps.

    A place is the number of a row, or lies between two; a lost step is the row before it and its joint.
    """
    count = len(time_s)
    rows = np.arange(count)
    missing = np.maximum(np.rint(np.diff(time_s) / period_s).astype(int) - 1, 0)
    added = [row + np.arange(1, missing[row] + 1) / (missing[row] + 1.0) for row in np.flatnonzero(missing)]
    places = np.sort(np.concatenate([rows.astype(np.float64), *added]))
    filled = _held(rows.astype(np.float64), rows.astype(np.float64), sent_pa)
    between = np.column_stack([np.interp(places, rows, column) for column in filled.T])
    lost = []
    for row in np.flatnonzero(missing).tolist():
        before, after = filled[row], filled[row + 1]
        slope = 0.5 * (before - filled[max(row - 1, 0)] + filled[min(row + 2, count - 1)] - after)
        long = time_s[row + 1] - time_s[row] > longest_gap_s(period_s)
        stepped = long | (np.abs(after - before - slope * (missing[row] + 1)) > READING.lost_step_pa)
        lost += [(row, int(joint)) for joint in np.flatnonzero(stepped)]
    return places, between, lost


def _is_on(grid_s: Array, time_s: Array) -> bool:
    """Whether every time (N,) is one of a uniform grid (T,), but for roundings."""
    places = (time_s - grid_s[0]) / (grid_s[-1] - grid_s[0]) * (len(grid_s) - 1)
    return bool(np.abs(places - np.rint(places)).max() < ROUNDING)


def _held(at_s: Array, time_s: Array, values: Array) -> Array:
    """The values (N, J) held from their times (N,) on, at times (T,); the first one also before it."""
    held = np.full((len(at_s), values.shape[1]), np.nan)
    rounding_s = ROUNDING * float(at_s[1] - at_s[0])
    for j, column in enumerate(values.T):
        known = np.isfinite(column)
        if known.any():
            held[:, j] = column[known][np.maximum(in_force(at_s + rounding_s, time_s[known]), 0)]
    return held


def _error(between_pa: Array, parts: int, pressure_pa: Array) -> float:
    """RMS error of the change of pressure from sample to sample, by a line over set-points and pressure; relative.

    A valve of any speed lets the change depend on the mean set-points of this sample and of those before it.
    """
    mean = between_pa[:-1].reshape(-1, parts, between_pa.shape[1]).mean(axis=1)
    left = scale = 0.0
    for u, p in zip(mean.T, pressure_pa.T, strict=True):
        change = np.diff(p)[2:]
        causes = np.column_stack([u[2:], u[1:-1], u[:-2], p[2:-1], p[1:-2], np.ones(len(change))])
        usable = np.isfinite(change) & np.isfinite(causes).all(axis=1)
        if usable.sum() <= causes.shape[1]:
            continue
        answer, *_ = np.linalg.lstsq(causes[usable], change[usable], rcond=None)
        left += float(np.sum((change[usable] - causes[usable] @ answer) ** 2))
        scale += float(np.sum(change[usable] ** 2))
    return math.sqrt(left / scale) if scale > 0.0 else 0.0
