"""When set-points stepped of which a table shows only that they did between two of its rows.

The valve's model says which pressures follow a step at each time since the row before; the step is put where they
differ least from the readings. The first reading behind a step is spent on that and does not count as a comparison.
Set-points stay at their rows where the readings follow them there about as well: who logs its own commands has them so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import Akima1DInterpolator

from hand_identification.free_parameters import FreeParameter, nominal_free_parameters
from hand_identification.joint_problem import JointProblem, Segment
from hand_identification.map_fit import MapFit, map_fit
from hand_identification.own_times import put_on_samples
from hand_identification.settings import FITS
from hand_model.arrays import Array

Places = NDArray[np.intp]


def settle_steps(problem: JointProblem) -> None:
    """Decide by the model when the set-points of tables came: as they were read, or between the rows.

    Between the rows they move smoothly but for the loose steps, which are placed. The numbers of the valve are fitted
    both ways, since wrong ones look like late set-points. Where set-points between the rows do not fit the pressures
    better, the steps stay at their rows and are loose no longer.
    """
    every = nominal_free_parameters(problem.nominal, FITS.step_tolerance, False)
    free = [parameter for parameter in every if parameter.key.startswith("valve.")]
    read, z = list(problem.segments), np.zeros(len(free))
    for _ in range(FITS.step_rounds):
        held = map_fit(problem, free, z, FITS.step_iterations)
        z = held.z
        put_on_samples(problem, free, z)
    problem.segments[:], z = [_smooth(segment) for segment in read], np.zeros(len(free))
    for _ in range(FITS.step_rounds):
        place_steps(problem, free, z)
        put_on_samples(problem, free, z)
        between = map_fit(problem, free, z, FITS.step_iterations)
        z = between.z
    held_pa2, between_pa2 = _squares(held), _squares(between)
    for n, segment in enumerate(problem.segments):
        use, steps = segment.use.copy(), _places(segment)
        spent = 1.0 - len(steps) / max(int(use[0].sum()), len(steps), 1)  # each step that is placed takes one reading
        if segment.loose is not None and between_pa2[n] < FITS.step_gain * spent * held_pa2[n]:
            use[0, 1 + steps] = False
            problem.segments[n] = replace(segment, use=use)
        else:
            problem.segments[n] = replace(read[n], loose=None)


def place_steps(problem: JointProblem, free: Sequence[FreeParameter], z: Array) -> None:
    """Put the loose steps of every segment where the valve's model at the coordinates z (free,) [-] sees them.

    Neighbouring steps are placed in turn, since the pressure after one depends on the one before.
    """
    places = [_places(segment) for segment in problem.segments]
    if problem.driven or not any(len(at) for at in places):
        return
    columns, starts = problem.columns(free, z[None])

    def stepped(shares: Sequence[Array]) -> list[Segment]:
        return [_stepped(each, at, share) for each, at, share in zip(problem.segments, places, shares, strict=True)]

    def residuals(shares: Sequence[Array]) -> list[Array]:
        segments = stepped(shares)
        predicted = replace(problem, segments=segments).predict(columns, starts)
        return [_residual(segment, readings[0, 0]) for segment, readings in zip(segments, predicted, strict=True)]

    shares = [np.full(len(at), 0.5) for at in places]
    for tried in FITS.step_shares:
        for turn in (0, 1):
            moved = [np.clip(share[None] + np.array(tried)[:, None], 0.0, 1.0) for share in shares]
            for share, candidates in zip(shares, moved, strict=True):
                candidates[:, 1 - turn :: 2] = share[1 - turn :: 2]
            errors = [residuals([candidates[k] for candidates in moved]) for k in range(len(tried))]
            for n, (segment, at) in enumerate(zip(problem.segments, places, strict=True)):
                squares = np.array([_after(segment, at, each[n]) for each in errors])
                shares[n][turn::2] = _lowest(moved[n], squares)[turn::2]
    problem.segments[:] = stepped(shares)


def _places(segment: Segment) -> Places:
    """Samples (n,) behind which a step came at an unknown time."""
    return np.flatnonzero(segment.loose) if segment.loose is not None else np.zeros(0, dtype=np.intp)


def _stepped(segment: Segment, at: Places, shares: Array) -> Segment:
    """The segment with each set-point in force for the last share of the time since the row before.

    That of an uneven row begins or ends in another sample. A part in which a step lies has the mean.
    """
    if not len(at):
        return segment
    parts, late = segment.parts, _late(segment)
    commanded, before = segment.commanded_pa.copy(), segment.set_point_pa[at]
    step = segment.set_point_pa[at + 1] - before
    came = parts * (1.0 + late[at + 1] - shares * (1.0 + late[at + 1] - late[at]))
    for part in range(parts):
        commanded[parts * at + part] = before
    for part in range(-parts, 2 * parts):
        in_force = np.clip(part + 1.0 - came, 0.0, 1.0)
        changed = np.clip(parts * at + part, 0, len(commanded) - 1)
        np.add.at(commanded, changed, step * (in_force - (part >= parts)))
    return replace(segment, commanded_pa=commanded)


def _late(segment: Segment) -> Array:
    """By how many samples each reading (T,) is later than its sample; 0 where there is none."""
    own = segment.own
    return np.nan_to_num(own.late_s) / segment.period_s if own is not None else np.zeros(len(segment.angle_rad))


def _squares(fit: MapFit) -> list[float]:
    """Sum of squared residuals [Pa^2] of the pressures of each segment that a fit leaves."""
    return [float(np.sum(residual[0] ** 2)) for residual in fit.residuals]


def _smooth(segment: Segment) -> Segment:
    """The segment with set-points that move smoothly from sample to sample; as it is if it is no table's.

    By cubics that keep to the data next to a jump (Akima, J. ACM 17(4), 1970).
    """
    samples = len(segment.angle_rad)
    if segment.loose is None or samples < 2:
        return segment
    parts = segment.parts
    curve = Akima1DInterpolator(np.arange(samples), segment.set_point_pa, method="makima")
    within = curve((np.arange(parts * (samples - 1)) + 0.5) / parts)
    return replace(segment, commanded_pa=np.append(within, segment.set_point_pa[-1]))


def _residual(segment: Segment, pressure_pa: Array) -> Array:
    """What a prediction (T,) leaves of the pressures that were read [Pa]."""
    return np.where(segment.known, segment.pressure_pa - pressure_pa, 0.0)


def _window(segment: Segment) -> int:
    """Readings behind a step that say when it came."""
    return max(round(FITS.step_window_s / segment.period_s), FITS.step_samples)


def _after(segment: Segment, at: Places, residual: Array) -> Array:
    """Sums of squared residuals (n,) [Pa^2] behind each step, up to the next one."""
    ends = np.minimum(at + 1 + _window(segment), np.append(at[1:] + 1, len(residual)))
    total = np.concatenate([[0.0], np.cumsum(residual**2)])
    return np.asarray(total[ends] - total[at + 1], dtype=np.float64)


def _lowest(shares: Array, squares: Array) -> Array:
    """Shares (n,) of the least squares (candidates, n), by a parabola through the best candidate and its neighbours."""
    count, steps = squares.shape
    best = np.clip(np.argmin(squares, axis=0), 1, count - 2)
    every = np.arange(steps)
    (x0, x1, x2), (y0, y1, y2) = (
        (values[best - 1, every], values[best, every], values[best + 1, every]) for values in (shares, squares)
    )
    left, right = (x1 - x0) * (y1 - y2), (x1 - x2) * (y1 - y0)
    bend = left - right
    with np.errstate(divide="ignore", invalid="ignore"):
        lowest = x1 - 0.5 * ((x1 - x0) * left - (x1 - x2) * right) / bend
    least = shares[np.argmin(squares, axis=0), every]
    inside = np.isfinite(lowest) & (bend < 0.0) & (np.abs(lowest - x1) <= np.maximum(x2 - x1, x1 - x0))
    return np.asarray(np.where(inside, lowest, least), dtype=np.float64)
