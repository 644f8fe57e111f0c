"""The steady clock behind stamps that scatter, and whether the readings belong to it or to their stamps.

A board samples on a steady clock. Where a host stamps its frames, the stamps scatter around that clock, and a reading
that is put at its stamp is wrong by speed times scatter. Where the samples themselves were taken at uneven times, and
the stamps are right, it is the other way round. The readings decide: at the right times they are smoother.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from hand_model.arrays import Array, Flags
from hand_recording.interpolation import interpolate, longest_gap_s
from hand_recording.loader import Recording, TopicData
from hand_recording.settings import READING
from hand_sim.sample_ticks import Ticks, rebuild_ticks

OUTCOMES = {
    None: "the error of a reading, its speed times that, is part of the noise",
    False: "readings are smooth at their own stamps and stay there",
    True: "readings are smoother on that clock and are put there",
}
MEASURED = ("joint_states", "pressures", "contact_forces")


def on_steady_clock(recording: Recording, ticks: Ticks, rate_hz: float) -> tuple[Recording, float, list[str]]:
    """The recording with the stamps of its readings moved to the ticks of a steady clock, where that is right.

    ticks: of joint_states.  Also the standard deviation [s] of the error of the samples' times that is left, and lines
    for the reader.
    """
    states = recording["joint_states"]
    stamps, first = np.unique(states.stamp_ns, return_index=True)
    scatter_s = stamp_scatter_s(stamps, ticks)
    if scatter_s < READING.min_scatter_periods * ticks.period_s:
        return recording, 0.0, []
    steady, line = (
        steadier(stamps, ticks, states["position"][first]),
        _scatter_line("stamps of joint_states", scatter_s),
    )
    if not steady:
        return recording, scatter_s if steady is None else 0.0, [line + OUTCOMES[steady]]
    moved = {name: _moved(recording[name], rate_hz, stamps, ticks) for name in MEASURED if name in recording}
    topics = recording.topics | {name: topic for name, topic in moved.items() if topic is not None}
    return replace(recording, topics=topics), 0.0, [line + OUTCOMES[steady]]


@dataclass(frozen=True, slots=True)
class TableClock:
    """Rising times (N,) [s] of the rows of a table, the uniform grid (T,) [s] for them, and the tick of each row.

    tick_s: (N,) times of the rows on the steady clock that they have; their own times where there is none.  jitter_s:
    standard deviation of the error of the times that is left.  notes: lines for the reader.
    """

    time_s: Array
    grid_s: Array
    tick_s: Array
    jitter_s: float = 0.0
    notes: tuple[str, ...] = ()


def steady_times(time_s: Array, grid_s: Array, values: Array) -> TableClock:
    """The clock of a table, its rows moved to the ticks of a steady clock where that is right.

    time_s: (N,) rising [s].  grid_s: (T,) [s], of their usual period.  values: (N, J) readings by which this is
    decided. Times that differ from a steady clock by no more than a rounding are put on it.
    """
    unsteady = TableClock(time_s, grid_s, time_s)
    stamps = np.rint((time_s - time_s[0]) * 1e9).astype(np.int64)
    if np.any(np.diff(stamps) <= 0):
        return unsteady
    ticks = rebuild_ticks(stamps, 1.0 / float(grid_s[1] - grid_s[0]))
    scatter_s, lost = stamp_scatter_s(stamps, ticks), 1.0 - len(stamps) / (int(ticks.number[-1]) + 1)
    # Times without a clock have one only if many ticks are lost.
    most = READING.max_scatter_periods if lost > READING.complete_clock else READING.max_complete_scatter_periods
    if scatter_s >= most * ticks.period_s:
        return unsteady
    clock = time_s[0] + 1e-9 * ticks.stamp_ns
    moved = TableClock(clock[ticks.number], clock, clock[ticks.number])
    # Roundings are spread evenly: their largest is 1.7 standard deviations.
    if np.abs(time_s - moved.tick_s).max() <= 2.0 * READING.min_scatter_periods * ticks.period_s:
        return moved
    if scatter_s <= READING.min_scatter_periods * ticks.period_s:
        return unsteady
    steady = steadier(stamps, ticks, values)
    notes = (_scatter_line("its times", scatter_s) + OUTCOMES[steady],)
    if steady:
        return replace(moved, notes=notes)
    return TableClock(time_s, clock, moved.tick_s, scatter_s if steady is None else 0.0, notes)


def has_reading(grid_s: Array, time_s: Array) -> Flags:
    """Which times of a uniform grid (T,) [s] have a reading of their own among rising times (N,) [s]."""
    after = np.clip(np.searchsorted(time_s, grid_s), 1, len(time_s) - 1)
    away = np.minimum(np.abs(time_s[after] - grid_s), np.abs(grid_s - time_s[after - 1]))
    return np.asarray(away <= READING.own_reading_periods * (grid_s[1] - grid_s[0]), dtype=bool)


def _scatter_line(what: str, scatter_s: float) -> str:
    return f"{what} scatter by {scatter_s * 1e3:.2g} ms (standard deviation) around a steady clock; "


def stamp_scatter_s(stamps_ns: NDArray[np.int64], ticks: Ticks) -> float:
    """Standard deviation [s] of rising stamps (N,) around their ticks, those of a clock that was set excepted."""
    error = (stamps_ns - ticks.stamp_ns[ticks.number]) * 1e-9
    error = error[np.abs(error) < ticks.period_s]
    return float(np.std(error)) if len(error) else 0.0


def steadier(stamps_ns: NDArray[np.int64], ticks: Ticks, values: Array) -> bool | None:
    """Whether readings (N, J) [any unit] are clearly smoother at their ticks than at their stamps (N,); None:
    neither is.

    Readings at the ticks are compared with those interpolated at the ticks from the stamps, by third differences. A
    line between two readings halves their noise, so readings put on ticks are smoothed until noise is as rough in both.
    """
    grid, longest_ns = ticks.stamp_ns, longest_gap_s(ticks.period_s) * 1e9
    share = np.abs(stamps_ns - grid[ticks.number]) / (ticks.period_s * 1e9)
    lost = np.interp(np.arange(len(grid)), ticks.number, np.minimum(share, 1.0))[1:-1, None]

    def both(readings: Array) -> tuple[Array, Array]:
        put = interpolate(grid, grid[ticks.number], readings, longest_ns)
        return put, interpolate(grid, stamps_ns, readings, longest_ns)[1:-1]

    def smoothed(put: Array, by: float) -> Array:
        return np.asarray(put[1:-1] + 0.5 * by * lost * (put[2:] - 2.0 * put[1:-1] + put[:-2]))

    noise_put, noise_own = both(np.random.default_rng(READING.noise_seed).standard_normal((len(stamps_ns), 1)))
    by = _root(lambda by: _roughness(smoothed(noise_put, by)) - _roughness(noise_own))
    put, own = both(values)
    rough = [_roughness(smoothed(put, by)), _roughness(own)]
    if rough[0] < READING.clearly_smoother * rough[1]:
        return True
    return False if rough[1] < READING.clearly_smoother * rough[0] else None


def _root(falling: Callable[[float], float]) -> float:
    """Where a falling function is 0 between 0 and 1; the end nearer to it where it is 0 nowhere."""
    if falling(0.0) <= 0.0:
        return 0.0
    return 1.0 if falling(1.0) >= 0.0 else float(brentq(falling, 0.0, 1.0))


def _roughness(values: Array) -> float:
    """Sum over the joints of the RMS of third differences (T, J), each relative to the range of its joint."""
    total = 0.0
    for column in np.diff(values, 3, axis=0).T:
        known = np.abs(column[np.isfinite(column)])
        if len(known):
            total += float(np.mean(np.sort(known)[: max(int(READING.motion_share * len(known)), 1)] ** 2))
    return float(np.sqrt(total))


def _moved(topic: TopicData, rate_hz: float, known_ns: NDArray[np.int64], known: Ticks) -> TopicData | None:
    """A topic with its stamps on a steady clock of its own, which keeps a delay between topics; None: too short.

    known: the ticks of the stamps known_ns (N,), which are not rebuilt for a topic of the same stamps.
    """
    stamps, places = np.unique(topic.stamp_ns, return_inverse=True)
    if len(stamps) < 2:
        return None
    ticks = known if np.array_equal(stamps, known_ns) else rebuild_ticks(stamps, rate_hz)
    return replace(topic, stamp_ns=ticks.stamp_ns[ticks.number][places])
