"""The sample clock of a board, rebuilt from the stamps of its frames: which tick each frame was taken at.

Stamps scatter, frames are lost, and a busy host stamps several frames late and close together. The clock is tracked
over the stamps; then each frame gets a tick of its own, in order, nearest to its stamp over the whole recording.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array

Stamps = NDArray[np.int64]

FIRST_FRAMES = 20
"""Frames from which the phase of the clock that numbers frames is taken at its start."""
MAX_DRIFT, MAX_WRONG_RATE = 0.03, 0.4
"""Relative deviation of a board's clock from its rate; largest one of that rate from the nominal one."""
CLOCK_GAIN = 0.05
"""Share of a frame's deviation from the expected tick by which the clock that numbers frames is corrected."""
STEADY = 0.3
"""Spread of the distances of stamps (their middle 80 %), in periods, up to which their median is the period."""
SEARCHED = (0.7, 1.4)
"""Rates that are searched where stamps scatter more, relative to that of the median distance."""
SEARCH_FRAMES, NEAR_FRAMES = 1000, 4000
"""Frames, from the first, in which they are searched, and in which a rate near the nominal one is sought before."""
COHERENT = 4.0
"""Coherence of a rate, over that of stamps without any clock, from which it counts: chance gives it once in 10,000."""

AS_COHERENT = 0.95
"""Coherence of a clock of constant rate, relative to that of a tracked one, from which it is the clock."""
FIRST_SPAN, FIRST_REACH = 2000, 0.02
"""Frames over which the search for a constant rate begins; how far the usual period may be wrong, relative."""
INCOHERENT = 0.3
"""Coherence below which phases show no clock, and the one with the least scatter is sought: normal scatter of 0.25
periods has this."""
COUNTED_SPAN, MOST_LOST = 1000, 0.1
"""Frames over which that search begins, and the largest share of lost ones among them."""


@dataclass(frozen=True, slots=True)
class Ticks:
    """The board's sample clock rebuilt from stamps: number (N,) of each recorded frame from 0, period_s [s]."""

    number: Stamps
    period_s: float
    start_ns: int

    @property
    def stamp_ns(self) -> Stamps:
        """Stamps of every tick from the first recorded frame to the last, lost frames included."""
        return self.start_ns + np.rint(np.arange(self.number[-1] + 1) * self.period_s * 1e9).astype(np.int64)


def rebuild_ticks(stamp_ns: Stamps, rate_hz: float) -> Ticks:
    """Number the frames by the sample clock they came from.

    rate_hz is nominal; the true period is fitted, so that a board clock that drifts loses no tick. Stamps may scatter
    by nearly half a period. Raises ValueError for fewer than two frames or stamps that do not ascend.
    """
    if len(stamp_ns) < 2 or np.any(np.diff(stamp_ns) <= 0):
        raise ValueError("the recording's frames must be two or more, with ascending stamps")
    since = (stamp_ns - stamp_ns[0]).astype(float)
    at = since * (1e-9 * rate_hz)
    usual = usual_period(at, nominal=1.0)
    tracked, steady = _tracked(at, usual), _steady(at, usual)
    # A clock that is tracked follows some of the scatter; one whose rate really changes is coherent in no other way.
    coherent = steady if _coherence(steady) > AS_COHERENT * _coherence(tracked) else tracked
    candidates = [ascending_ticks(coherent), np.arange(len(at))]
    if _coherence(coherent) < INCOHERENT:
        candidates.append(_least_scattered(at))
    number = min(candidates, key=lambda numbers: _surprise(at, numbers))
    slope, intercept = np.polyfit(number, since, 1)
    return Ticks(number, float(slope) * 1e-9, int(stamp_ns[0] + round(float(intercept))))


def _surprise(at: Array, number: Stamps) -> float:
    """Bayesian information criterion of ticks (N,) of frames at times (N,): scatter, and the frames that are lost.

    A wide scatter has no phase that could show a clock, and then hides lost frames as well.
    """
    slope, intercept = np.polyfit(number, at, 1)
    scatter = float(np.mean(((at - intercept) / slope - number) ** 2)) + STEADY**2 / len(at)
    return len(at) * float(np.log(scatter)) + 2.0 * float(np.log(len(at))) * float(number[-1] + 1 - len(at))


def _least_scattered(at: Array) -> Stamps:
    """Ticks (N,) of frames at times (N,) on the clock of constant rate that leaves the least scatter.

    Where stamps scatter by nearly half a period, their phases show no clock. Each frame has a tick of its own, though,
    so the rate is at least that of the frames, and with a wrong number of lost ones frames drift away from their ticks.
    """
    count = min(COUNTED_SPAN, len(at))
    most = count - 1 + np.arange(0.0, MOST_LOST * count, 0.5)
    while True:
        span = float(at[count - 1] - at[0])
        ticks = [_ticks_of_own(at[:count] * (each / span)) for each in most]
        surprise = [_surprise(at[:count], each) for each in ticks]
        best = int(np.argmin(surprise))
        if count == len(at):
            return ticks[best]
        further = min(2 * count, len(at))
        expected = float(most[best]) * float(at[further - 1] - at[0]) / span
        count, most = further, expected + np.arange(-2.0, 2.1, 0.25)


def _ticks_of_own(places: Array) -> Stamps:
    """Ascending ticks (N,) from 0 nearest to places (N,) [ticks] of which only the phase is unknown.

    Between lost frames, the mean distance of frames from their ticks shows it.
    """
    levels = _levels(places)
    phase = float(np.angle(np.exp(2j * np.pi * levels).sum())) / (2.0 * np.pi)
    return _from_zero(np.rint(levels - phase))


def usual_period(at: Array, nominal: float | None = None) -> float:
    """The period of the clock behind ascending times (N,), in their unit [any]; nominal: what it should be [the same].

    The median distance, unless the times scatter so much that few distances are near it; then the period, near the
    nominal one or else in a wide range, for which the times have the most coherent phase (the periodogram of events:
    Bartlett, The spectral analysis of point processes, 1963).
    """
    distances = np.diff(at)
    low, median, high = np.quantile(distances, [0.1, 0.5, 0.9])
    if high - low <= STEADY * median:
        return float(median)
    ranges = [(SEARCH_FRAMES, SEARCHED[0] / median, SEARCHED[1] / median)]
    if nominal is not None:
        ranges.insert(0, (NEAR_FRAMES, (1.0 - MAX_DRIFT) / nominal, (1.0 + MAX_DRIFT) / nominal))
    for frames, slowest, fastest in ranges:
        times = at[:frames] - at[0]
        finest = 0.2 / max(float(times[-1]), float(median))
        rates = np.arange(slowest, fastest, finest)
        coherence = np.array([abs(np.exp(2j * np.pi * rate * times).sum()) for rate in rates])
        best = int(np.argmax(coherence))
        if coherence[best] > COHERENT * len(times) ** 0.5:
            return 1.0 / float(rates[best])
    return float(median)


def _steady(at: Array, usual: float) -> Array:
    """Places (N,) of frames at ascending times (N,) on the clock of constant rate with the most coherent phase."""
    rate = 1.0 / usual
    count = min(FIRST_SPAN, len(at))
    reach = FIRST_REACH * rate
    while True:
        span = max(float(at[count - 1] - at[0]), 1.0 / rate)
        rates = rate + np.arange(-reach, reach + 0.1 / span, 0.1 / span)
        rate = float(rates[np.argmax([abs(np.exp(2j * np.pi * r * at[:count]).sum()) for r in rates])])
        if count == len(at):
            break
        count, reach = min(2 * count, len(at)), 0.3 / span
    return at * rate - float(np.angle(np.exp(2j * np.pi * rate * at).sum())) / (2.0 * np.pi)


def _coherence(places: Array) -> float:
    """How alike the phases of places (N,) on a clock are: 1 on its ticks, 0 anywhere."""
    return float(abs(np.exp(2j * np.pi * places).mean()))


def _tracked(at: Array, usual: float) -> Array:
    """Places (N,) of frames at ascending times (N,), in nominal periods, on a clock that tracks their phase and rate.

    usual: period, in nominal ones, which counts where it is clearly another one. A second-order loop (Gardner,
    Phaselock Techniques, 2005) of gains CLOCK_GAIN and, for the rate, its square / 4, which is critically damped.
    """
    usual = usual if MAX_DRIFT < abs(usual - 1.0) < MAX_WRONG_RATE else 1.0
    first = np.mean(np.exp(2j * np.pi * at[:FIRST_FRAMES] / usual))  # the phase of the first stamp alone scatters
    expected = float(np.angle(first)) / (2.0 * np.pi) * usual
    places, rate, tick = np.zeros(len(at)), usual, 0
    for k, now in enumerate(at.tolist()):
        ticks = round((now - expected) / rate)
        error = now - expected - ticks * rate
        tick += ticks
        places[k] = tick + error / rate
        expected += ticks * rate + CLOCK_GAIN * error
        rate = min(max(rate + 0.25 * CLOCK_GAIN**2 * error, (1.0 - MAX_DRIFT) * usual), (1.0 + MAX_DRIFT) * usual)
    return places


def ascending_ticks(places: Array) -> Stamps:
    """Ascending ticks (N,) from 0 nearest to the places (N,) [ticks] of frames on a clock, in least squares.

    Each frame has a tick of its own, so the number of lost frames before it never falls: an isotonic regression,
    then rounded, which is the best fit in whole numbers.
    """
    return _from_zero(np.rint(_levels(places)))


def _levels(places: Array) -> Array:
    """By how much places (N,) [ticks] are ahead of the frames' numbers, never falling, in least squares.

    By pooling neighbours (Barlow et al., Statistical inference under order restrictions, 1972).
    """
    lost: list[float] = []
    weights: list[int] = []
    for value in (places - np.arange(len(places))).tolist():
        lost.append(value)
        weights.append(1)
        while len(lost) > 1 and lost[-2] > lost[-1]:
            value, weight = lost.pop(), weights.pop()
            lost[-1] = (lost[-1] * weights[-1] + value * weight) / (weights[-1] + weight)
            weights[-1] += weight
    return np.repeat(lost, weights)


def _from_zero(lost: Array) -> Stamps:
    """Ticks (N,) of frames before which these numbers (N,) of frames were lost; the first one is tick 0."""
    number = lost.astype(np.int64) + np.arange(len(lost))
    return np.asarray(number - number[0], dtype=np.int64)
