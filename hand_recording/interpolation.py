"""Samples at other times than their own: the rules by which every reader of recordings interpolates, holds, bridges."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array, Flags
from hand_recording.settings import READING

Times = NDArray[Any]
"""Rising times, (n,): integers [ns] or floats [s]."""


def longest_gap_s(period_s: float) -> float:
    """Largest distance [s] of two readings between which a signal of that sample period is interpolated."""
    return max(READING.longest_gap_s, READING.longest_gap_periods * period_s)


def interpolate(times: Times, stamps: Times, values: Array, max_gap: float) -> Array:
    """Values at rising `stamps` (N,), (N,) or (N, J), linearly at `times` (T,): (T,) or (T, J).

    NaN before the first stamp, behind the last, and between stamps that are farther apart than max_gap [unit
    of the times]. A time that equals a stamp gets that very sample, also next to a NaN or a gap.
    """
    if not len(stamps):
        return np.full((len(times), *values.shape[1:]), np.nan)
    after = np.clip(np.searchsorted(stamps, times), 1, max(len(stamps) - 1, 1))
    after = np.minimum(after, len(stamps) - 1)
    before = np.maximum(after - 1, 0)
    span = stamps[after] - stamps[before]
    share = (times - stamps[before]) / np.where(span > 0, span, 1)
    share = share.reshape(-1, *[1] * (values.ndim - 1))
    result: Array = values[before] + share * (values[after] - values[before])
    result[(times < stamps[0]) | (times > stamps[-1]) | (span > max_gap)] = np.nan
    for ends in (before, after):
        hit = times == stamps[ends]
        result[hit] = values[ends[hit]]
    return result


def in_force(times: Times, starts: Times) -> NDArray[np.intp]:
    """Row of `starts` (rising) that began last at each time, (T,); -1 before the first."""
    rows: NDArray[np.intp] = np.searchsorted(starts, times, side="right") - 1
    return rows


def in_order(stamps: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    """Rising stamps (n,) without repetitions, and their rows in the original order; of equal stamps the last row."""
    rows = np.argsort(stamps, kind="stable")
    ordered = stamps[rows]
    last = np.append(ordered[1:] != ordered[:-1], True)
    return ordered[last], rows[last]


def on_clock(times_ns: NDArray[np.int64], sent_ns: NDArray[np.int64], shown_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Times of sending (n,) [ns] as another clock shows them, linearly between two of its ticks.

    sent_ns, shown_ns: (k,) when each tick was sent, in any order, and what it showed.
    """
    ticks, rows = in_order(sent_ns)
    shown = shown_ns[rows]
    passed = np.interp((times_ns - ticks[0]).astype(float), (ticks - ticks[0]).astype(float), shown - shown[0])
    converted: NDArray[np.int64] = shown[0] + np.rint(passed).astype(np.int64)
    return converted


def bridge(values: Array) -> tuple[Array, Flags]:
    """Columns of (T,) or (T, J) [any unit] with NaN replaced by linear interpolation over the samples, and where
    they were known.

    Before the first known sample the first one stands, behind the last one the last; a column that is never known is 0.
    """
    known = np.isfinite(values)
    filled = np.zeros_like(values)
    at = np.arange(len(values))
    columns = (array.reshape(len(values), -1).T for array in (filled, values, known))
    for column, source, where in zip(*columns, strict=True):
        if where.any():
            column[:] = np.interp(at, at[where], source[where])
    return filled, known


def refine(values: Array, finer: int) -> Array:
    """Samples (T,) or (T, J) [any unit], linearly interpolated to finer times as many: (finer (T - 1) + 1, ...)."""
    samples = np.arange(len(values))
    at = np.arange(finer * (len(values) - 1) + 1) / finer
    if values.ndim == 1:
        return np.interp(at, samples, values)
    return np.column_stack([np.interp(at, samples, column) for column in values.T])
