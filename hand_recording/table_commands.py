"""When the set-points of a table came into force: at its rows, at the ticks of a steady clock, or between its rows.

A row says which set-point is in force, and its stamp when its readings were taken. Where rows are stamped at uneven
times, the set-point may still have been sent by a steady clock. Where a table has fewer rows than there were commands,
the set-points moved between the rows, along a straight line where they are smooth. The measured pressures decide what
they follow; where they do not, the stamp counts. A step may have come at any time since the row before; where the
pressures say so, the model of the valve says when (hand_identification/step_times.py).

A row that is missing takes its set-point with it. A straight line between its neighbours replaces it. Where these
differ by more than their slopes say, a step came at an unknown time, and the readings until the pressure has settled
are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array, Flags
from hand_recording.interpolation import in_force, longest_gap_s
from hand_recording.own_readings import ROUNDING
from hand_recording.sample_clock import TableClock
from hand_recording.settings import READING


@dataclass(frozen=True, slots=True)
class TableCommands:
    """Set-points in force and what cannot be compared with them.

    set_point_pa: (T, J) [Pa] of the row of each sample.  between_pa: (parts (T - 1) + 1, J) [Pa], mean of each part.
    unknown: (T, J) readings after a step that was lost with its row.  loose: (T - 1, J) samples within which a step
    may have come at any time.  refused: (J,) joints whose steps came between the rows, and too often to say when.
    """

    set_point_pa: Array
    between_pa: Array
    parts: int
    unknown: Flags
    loose: Flags
    refused: Flags


def set_points_between(clock: TableClock, sent_pa: Array, pressure_pa: Array) -> TableCommands:
    """When set-points sent_pa (N, J) [Pa] of the rows of a table came into force; NaN where none is given.

    pressure_pa: (N, J) measured; NaN where there is none.
    """
    grid, rows = clock.grid_s, np.arange(len(clock.time_s), dtype=np.float64)
    period_s = float(grid[-1] - grid[0]) / (len(grid) - 1)
    parts = max(math.ceil(period_s / READING.part_s), 1)
    fine = grid[0] + period_s / parts * np.arange(parts * (len(grid) - 1) + 1)
    sent = _held(rows, rows, sent_pa)
    missing = np.maximum(np.rint(np.diff(clock.tick_s) / period_s).astype(np.int64) - 1, 0)
    places, added = _with_missing(sent, missing)
    clearly = 1.0 - READING.clearly_beyond_chance / math.sqrt(len(grid))

    def sent_at(at_rows_s: Array) -> Array:
        return np.asarray(np.interp(places, rows, at_rows_s))

    def misses(sent_s: Array, *, ahead: bool = False) -> Array:
        return _errors(_means(clock.time_s, sent_s, added), clock.time_s, pressure_pa, ahead=ahead)

    sent_s = sent_at(clock.time_s)
    errors = misses(sent_s)
    if not np.array_equal(clock.time_s, clock.tick_s):
        on_ticks = misses(sent_at(clock.tick_s))
        if on_ticks.sum() < clearly * errors.sum():
            sent_s, errors = sent_at(clock.tick_s), on_ticks
    at_samples = _held(grid, sent_at(clock.tick_s), added)
    between = _means(np.append(fine, fine[-1] + period_s), sent_s, added)
    slow = misses(sent_s, ahead=True) < clearly * errors
    change, beyond = np.abs(np.diff(sent, axis=0)), _beyond_slope(sent, missing)
    stepped = beyond > READING.lost_step_pa
    jumped = stepped & (change > READING.lost_step_pa) & (beyond > READING.jump_share * change)
    between_rows = jumped & (missing == 0)[:, None]
    many = between_rows.mean(axis=0) > READING.most_between_rows
    refused = slow & many
    if (slow & ~refused).any():
        line = np.column_stack([np.interp(fine, clock.tick_s, column) for column in sent.T])
        between = np.where(slow & ~refused, line, between)
        at_samples = np.where(slow & ~refused, line[::parts], at_samples)
    loose = np.zeros((len(grid) - 1, sent.shape[1]), dtype=bool)
    ticks = np.rint((clock.tick_s[:-1] - grid[0]) / period_s).astype(np.int64)
    loose[np.clip(ticks, 0, len(grid) - 2)] = between_rows & ~many
    long = np.diff(clock.time_s) > longest_gap_s(period_s)
    unknown = _after_lost(clock, (stepped | long[:, None]) & (missing > 0)[:, None])
    return TableCommands(at_samples, between, parts, unknown, loose, refused)


def _with_missing(sent_pa: Array, missing: NDArray[np.int64]) -> tuple[Array, Array]:
    """Places (M,) and set-points (M, J) of all rows and of those that are missing between them.

    A place is the number of a row, or lies between two.
    """
    rows = np.arange(len(sent_pa), dtype=np.float64)
    added = [row + np.arange(1, missing[row] + 1) / (missing[row] + 1.0) for row in np.flatnonzero(missing)]
    places = np.sort(np.concatenate([rows, *added]))
    return places, np.column_stack([np.interp(places, rows, column) for column in sent_pa.T])


def _beyond_slope(sent_pa: Array, missing: NDArray[np.int64]) -> Array:
    """Changes of set-points (N - 1, J) [Pa] from row to row beyond the mean of the changes around them.

    missing: (N - 1,) rows that are missing behind each.
    """
    change = np.diff(sent_pa, axis=0)
    before, after = change[np.maximum(np.arange(len(change)) - 1, 0)], np.vstack([change[1:], change[-1:]])
    return np.asarray(np.abs(change - 0.5 * (before + after) * (missing + 1)[:, None]))


def _after_lost(clock: TableClock, lost: Flags) -> Flags:
    """Flags (T, J) of the readings after a step that was lost with its row. lost: (N - 1, J) behind which row."""
    grid, time_s = clock.grid_s, clock.time_s
    flags = np.zeros((len(grid), lost.shape[1]), dtype=bool)
    for row in np.flatnonzero(lost.any(axis=1)).tolist():
        first, end = np.searchsorted(grid, [time_s[row] + 1e-9, time_s[row + 1] + READING.lost_step_s])
        flags[first:end, lost[row]] = True
    return flags


def _held(at_s: Array, time_s: Array, values: Array) -> Array:
    """The values (N, J) held from their times (N,) on, at times (T,); the first one also before it."""
    held = np.full((len(at_s), values.shape[1]), np.nan)
    rounding_s = ROUNDING * float(at_s[1] - at_s[0])
    for j, column in enumerate(values.T):
        known = np.isfinite(column)
        if known.any():
            held[:, j] = column[known][np.maximum(in_force(at_s + rounding_s, time_s[known]), 0)]
    return held


def _means(edges_s: Array, time_s: Array, values: Array) -> Array:
    """Means (M - 1, J) between rising times (M,) of values held as by `_held`: a step in between has its share."""
    means, span_s = _held(edges_s[:-1], time_s, values), np.diff(edges_s)
    for mean, column in zip(means.T, values.T, strict=True):
        known = np.isfinite(column)
        steps, starts = np.diff(column[known]), time_s[known][1:]
        part = np.searchsorted(edges_s + ROUNDING * span_s[0], starts) - 1
        inside = (part >= 0) & (part < len(span_s))
        part, steps, starts = part[inside], steps[inside], starts[inside]
        share = (edges_s[part + 1] - starts) / span_s[part]
        np.add.at(mean, part, np.where(share > ROUNDING, share, 0.0) * steps)
    return means


def _errors(mean_pa: Array, time_s: Array, pressure_pa: Array, *, ahead: bool = False) -> Array:
    """Relative RMS errors (J,) of the rate of the pressure from row to row, by a line over set-points and pressure.

    mean_pa: (N - 1, J) between the rows.  A valve of any speed lets the rate depend on the mean set-points of this
    step and of those before it. ahead: it may depend on those of the next one, too, which no valve knows (Granger,
    Econometrica 37(3), 1969).
    """
    step_s = np.diff(time_s)
    usual = np.abs(step_s - np.median(step_s)) < 0.5 * np.median(step_s)
    even = usual[3:] & usual[2:-1] & usual[1:-2] & usual[:-3]
    errors = np.zeros(mean_pa.shape[1])
    for j, (u, p) in enumerate(zip(mean_pa.T, pressure_pa.T, strict=True)):
        change = (np.diff(p) / step_s)[2:-1]
        causes = np.column_stack([u[2:-1], u[1:-2], u[:-3], p[2:-2], p[1:-3], np.ones(len(change)), u[3:]])
        causes = causes if ahead else causes[:, :-1]
        usable = even & np.isfinite(change) & np.isfinite(causes).all(axis=1)
        if usable.sum() > causes.shape[1] and np.ptp(change[usable]) > 0.0:
            answer, *_ = np.linalg.lstsq(causes[usable], change[usable], rcond=None)
            errors[j] = np.std(change[usable] - causes[usable] @ answer) / np.std(change[usable])
    return errors
