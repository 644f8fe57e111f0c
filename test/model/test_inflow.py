"""The inflow of a hand that sags its supply: solved where it jumps, expected where it goes on, and complete in sum.

Without a loop of the plant, so that a mutation run can use these tests.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hand_model.arrays import Array
from hand_model.kernel.inflow import AGE, FOUND, MISSING, OLD_STEPS, TRIALS, USED, changes, flows, note
from hand_model.kernel.inline import inline
from hand_model.kernel.lanes import LANES
from hand_model.kernel.layout import AFTER, ARRIVAL, BEFORE, FILLING, INFLOW_OF_HAND, OF_HAND, WORK, P, X
from hand_model.kernel.rows import STEP_S

SENSITIVITY = 0.4
"""Fall of what the joints take together, per inflow."""
EACH = SENSITIVITY / LANES


@inline
def taken(w: Any, i: int, n: int, e: Any, h: float) -> float:
    """What a joint takes [Pa/s] in place of a trial: a number of its own, and less where the supply has sagged."""
    rate: float = max(w[X + P, i] - EACH * w[INFLOW_OF_HAND, i], 0.0)
    return rate


@inline
def nothing_around(w: Any, i: int, clock: float, h: float) -> float:
    return 0.0


STAGES = flows(SimpleNamespace(inflow=taken, split_inflow=taken), nothing_around)  # type: ignore[arg-type]


def advanced(w: Array, wanted: float, *, jumps: bool = False, split: bool = False) -> float:
    """The inflow of one step in which the joints would take `wanted` together, were there no sag [Pa/s]."""
    w[X + P] = wanted / LANES
    if split:
        STAGES["split_flows"](w, 0, 0.0, STEP_S)
    else:
        STAGES["flows"](w, 0, 0.0, STEP_S, jumps)
    inflow = float(w[INFLOW_OF_HAND, 0])
    assert np.all(w[INFLOW_OF_HAND] == inflow)
    w[FILLING] = [taken(w, i, 0, None, STEP_S) for i in range(LANES)]
    note(w, jumps, STEP_S)
    return inflow


def solution(wanted: float) -> float:
    return wanted / (1.0 + SENSITIVITY)


@pytest.mark.parametrize("split", [False, True])
def test_the_inflow_of_a_jump_is_solved(split: bool) -> None:
    """Broken by one trial alone, by a slope of the wrong points, or by an inflow that is expected from before."""
    w = np.zeros((WORK, LANES))
    for wanted in (1e7, 3e6, 8e7):
        assert advanced(w, wanted, jumps=True, split=split) == pytest.approx(solution(wanted), rel=1e-9)


def test_an_inflow_that_goes_on_needs_no_trial() -> None:
    """Broken by a trial in every step, which takes a third of the time of all effects, or by none for ever."""
    w = np.zeros((WORK, LANES))
    advanced(w, 1e7, jumps=True)
    tried = []
    for n in range(1, OLD_STEPS + 12):
        wanted = 1e7 - 1e4 * n
        assert advanced(w, wanted) == pytest.approx(solution(wanted), rel=1e-9)
        tried.append(w[OF_HAND, AGE] == 1.0)
    assert tried[:3] == [True] * 3
    assert sum(tried[3:]) == 1


def test_what_a_step_lacks_the_next_one_has() -> None:
    """Broken by an inflow that is lost for the supply where it bends, or jumps without a set-point."""
    w = np.zeros((WORK, LANES))
    advanced(w, 1e7, jumps=True)
    for n in range(40):
        advanced(w, 1e7 if n < 10 else 1e7 - 1e5 * (n - 10) if n < 20 else 2e7)
        if n in (11, 20):  # the first steps that differ from what goes on
            assert abs(w[OF_HAND, MISSING]) > 1e4
        elif n > 3:
            assert w[OF_HAND, MISSING] == pytest.approx(0.0, abs=1e-3)
    assert w[OF_HAND, USED] == pytest.approx(w[OF_HAND, FOUND], rel=1e-9)


def test_an_unexpected_inflow_is_tried() -> None:
    """Broken by expectations that go on although the last one was wrong by more than a hundredth."""
    w = np.zeros((WORK, LANES))
    for n in range(8):
        advanced(w, 1e7, jumps=n == 0)
    assert w[OF_HAND, TRIALS] == 0.0
    advanced(w, 1.1e7)
    assert w[OF_HAND, TRIALS] == 1.0


def test_the_steps_in_which_set_points_change_are_known() -> None:
    """Broken by a change that is missed, or one where the set-point stays."""
    w = np.zeros((WORK, LANES))
    assert changes(w, 10) == (10, -1)
    w[ARRIVAL], w[AFTER, 3], w[AFTER, 5] = 1.0, 1e5, 2e5
    w[ARRIVAL, 3], w[ARRIVAL, 5], w[BEFORE, 7], w[AFTER, 7] = 2.4, 6.0, 1e5, 1e5
    assert changes(w, 10) == (2, 6)
