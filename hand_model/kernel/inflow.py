"""The inflow of a whole hand in a step of the closed loop: its joints share the supply, which sags with all of them.

What the supply lacks depends on the inflow of the same step: the inflow solves I = f(I), where f adds up what the
joints take. As long as the last steps say what to expect, f is taken for linear: its slope is known, and its value
goes on in a straight line. An expectation leaves no error in the sum of the inflows, since what a step has too little
the next one has more. Elsewhere f is computed by a trial of the step, in which no pressure is kept and no memory
changes, and a step of the secant method follows. Where a set-point jumps, and in the two steps after it, the steps
before give no information, and there are two trials.
"""

from __future__ import annotations

from typing import Any

from hand_model.kernel.inline import inline
from hand_model.kernel.lanes import HALF, LANES
from hand_model.kernel.layout import AFTER, ARRIVAL, BEFORE, FILLING, INFLOW_OF_HAND, OF_HAND
from hand_model.kernel.step import Steps

FOUND, FOUND_BEFORE, USED, USED_BEFORE, MISSING, EXPECTED, SLOPE, TRIED, TRIED_FOUND, TRIALS, AGE = range(11)
"""Lanes of OF_HAND [Pa/s]: inflow found in the last step and in the one before, and those with which the joints were
advanced; what the latter lack in sum; what was expected of the last step; slope of f [-]; inflow of the last trial and
what it found; number of steps that still need trials [-]; steps since the last trial [-]."""
AFTER_JUMP = 3.0
"""Trials at the next step and at the one after; the third step has one."""
WRONG_SHARE, WRONG_PA = 0.01, 1.0
"""Error of an expected inflow after which the next step is tried: as a share of it, and by what it does to all
pressures together in one step [Pa]."""
OLD_STEPS = 32
"""Number of steps after which the slope is found again by a trial."""
LEAST_CHANGE = 1e-7
"""Least difference of two inflows, as a share, that gives a slope."""


@inline
def changes(w, steps):  # type: ignore[no-untyped-def]
    """The first and the last of the steps of a sample in which a set-point changes."""
    first, last = steps, -1
    for i in range(LANES):
        at = int(w[ARRIVAL, i])
        if w[BEFORE, i] != w[AFTER, i]:
            first, last = min(first, at), max(last, at)
    return first, last


@inline
def _whole(w):  # type: ignore[no-untyped-def]
    """Sum of the rates of filling [Pa/s]; it is added up in pairs, several at a time."""
    for i in range(HALF):
        w[FILLING, i] += w[FILLING, i + HALF]
    a, b = w[FILLING, 0] + w[FILLING, 4], w[FILLING, 1] + w[FILLING, 5]
    c, d = w[FILLING, 2] + w[FILLING, 6], w[FILLING, 3] + w[FILLING, 7]
    return (a + c) + (b + d)


@inline
def _slope(w, tried, found):  # type: ignore[no-untyped-def]
    """Slope of f from the last trial to another inflow; more inflow is more sag, so none is above 0."""
    way = tried - w[OF_HAND, TRIED]
    moved = abs(way) > LEAST_CHANGE * abs(tried)
    return min((found - w[OF_HAND, TRIED_FOUND]) / way, 0.0) if moved else w[OF_HAND, SLOPE]


@inline
def _expect(w):  # type: ignore[no-untyped-def]
    """The inflow that f and what is missing lead to, with f as a line whose value at 0 goes on as in the last steps."""
    slope, missing = w[OF_HAND, SLOPE], w[OF_HAND, MISSING]
    last = w[OF_HAND, FOUND] - slope * w[OF_HAND, USED]
    before = w[OF_HAND, FOUND_BEFORE] - slope * w[OF_HAND, USED_BEFORE]
    ahead = 2.0 * last - before
    inflow = max((ahead + missing) / (1.0 - slope), 0.0)
    w[OF_HAND, EXPECTED] = ahead + slope * inflow
    return inflow


@inline
def _spread(w, inflow):  # type: ignore[no-untyped-def]
    for i in range(LANES):
        w[INFLOW_OF_HAND, i] = inflow


@inline
def note(w, jumps, h):  # type: ignore[no-untyped-def]
    """Keep the inflow of a step, and spread the one that is expected of the next one, while the joints move.

    jumps: whether a set-point changed in the step.
    """
    found, used = _whole(w), w[INFLOW_OF_HAND, 0]
    slope = _slope(w, used, found) if not jumps and w[OF_HAND, AGE] == 0.0 else w[OF_HAND, SLOPE]
    wrong = abs(found - w[OF_HAND, EXPECTED])
    unsure = wrong > WRONG_SHARE * found or -slope * wrong * h > WRONG_PA or w[OF_HAND, AGE] >= OLD_STEPS
    w[OF_HAND, SLOPE] = slope
    w[OF_HAND, MISSING] = 0.0 if jumps else w[OF_HAND, MISSING] + found - used
    w[OF_HAND, FOUND_BEFORE], w[OF_HAND, FOUND] = w[OF_HAND, FOUND], found
    w[OF_HAND, USED_BEFORE], w[OF_HAND, USED] = w[OF_HAND, USED], used
    w[OF_HAND, TRIALS] = AFTER_JUMP if jumps else max(w[OF_HAND, TRIALS] - 1.0, 1.0 if unsure else 0.0)
    w[OF_HAND, AGE] += 1.0
    _spread(w, _expect(w))


@inline
def _improve(w, tried, again):  # type: ignore[no-untyped-def]
    """The inflow after a trial; again: whether it is the second one."""
    found = _whole(w)
    if again:
        w[OF_HAND, SLOPE] = _slope(w, tried, found)
    w[OF_HAND, TRIED], w[OF_HAND, TRIED_FOUND], w[OF_HAND, AGE] = tried, found, 0.0
    inflow = max(tried + (found + w[OF_HAND, MISSING] - tried) / (1.0 - w[OF_HAND, SLOPE]), 0.0)
    _spread(w, inflow)
    return inflow


def flows(steps: Steps, around: Any) -> dict[str, Any]:
    """Functions of a loop that find the inflow of a step, whole or split; around: what surrounds a lane."""
    inflow, split_inflow = steps.inflow, steps.split_inflow

    @inline
    def whole_flows(w, n, clock, h, jumps):  # type: ignore[no-untyped-def]
        unknown = jumps or w[OF_HAND, TRIALS] > 1.0
        tried, trials = w[INFLOW_OF_HAND, 0], int(w[OF_HAND, TRIALS])
        if unknown:
            tried, trials = w[OF_HAND, FOUND], 2
            _spread(w, tried)
        for trial in range(trials):
            for i in range(LANES):
                w[FILLING, i] = inflow(w, i, n, around(w, i, clock, h), h)
            tried = _improve(w, tried, trial > 0)

    @inline
    def split_flows(w, n, clock, h):  # type: ignore[no-untyped-def]
        tried = w[OF_HAND, FOUND]
        _spread(w, tried)
        for trial in range(2):
            for i in range(LANES):
                w[FILLING, i] = split_inflow(w, i, n, around(w, i, clock, h), h)
            tried = _improve(w, tried, trial > 0)

    return {"flows": whole_flows, "split_flows": split_flows, "note": note, "changes": changes}
