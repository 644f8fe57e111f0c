"""Angles that were exchanged before arming: suspected by the first motions, confirmed twice, never on a push alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from hand_control.place_watch import (
    _ANSWERS,
    _STATE,
    _STAYS,
    _WAITS,
    ALIKE_S,
    CAUTION_PA_PER_S,
    NONE,
    QUESTIONS,
    PlaceWatch,
    check_places,
    hold_places,
)
from hand_control.sensor_watch import SensorWatch
from hand_model.arrays import Array
from hand_model.description import load_hand
from validation.faults.sensors import CONFIG, Case, study

HAND = load_hand(CONFIG / "hand.yaml")
DT, RECENT_S = 0.005, 0.5
RAD_PER_PA = 1e-5
Measured = Callable[[int, Array], Array]


def outcome(
    measured: Measured,
    time_s: float = 4.0,
    asked_pa: Callable[[int], float] = lambda frame: 1e5,
    neighbour: float = 0.0,
) -> tuple[int, int, float]:
    """Pair found, number of questions and highest set-point [Pa] of three joints, of which the first is to bend.

    measured: (frame, angles that the pressures ask for (3,)) -> measured angles (3,) [rad].  asked_pa: of a frame.
    neighbour: share of it that the second joint gets.
    """
    watch = PlaceWatch(np.array([1, 2, -1]))
    pressure, w, u = np.zeros(3), np.zeros(3), np.zeros(3)
    watch.start(pressure)
    at, angle = np.zeros(3), measured(0, np.zeros(3))
    questions, asked, highest = 0, False, 0.0
    kept = 1.0 - DT / (DT + RECENT_S)
    for frame in range(1, round(time_s / DT)):
        model, now = pressure * RAD_PER_PA, measured(frame, pressure * RAD_PER_PA)
        w, u = kept * (w + model - at), kept * (u + now - angle)
        at, angle = model, now
        found = check_places(watch.state, watch.after, w, u, now, model, DT)
        if found != NONE:
            return found, questions, highest
        command = np.array([asked_pa(frame), neighbour * asked_pa(frame), 0.0])
        hold_places(watch.state, command, pressure, DT)
        held = bool(watch.state[_STATE, 0] in (_ANSWERS, _STAYS))
        questions += int(held and not asked)
        asked = held
        highest = max(highest, float(command[0]))
        pressure = pressure + (command - pressure) * DT / 0.03
    return NONE, questions, highest


def test_an_exchange_is_confirmed_by_two_answers() -> None:
    """Fails when an exchange is not found, is found without questions, or lets the pressure rise meanwhile."""
    pair, questions, highest = outcome(lambda frame, model: model[[1, 0, 2]])
    assert (pair, questions) == (0, QUESTIONS)
    assert highest < 3e4


@pytest.mark.parametrize("neighbour", [0.2, 0.4])
def test_an_exchange_is_found_where_both_joints_move(neighbour: float) -> None:
    """Fails when an exchange counts only while one of both joints stands still."""
    assert outcome(lambda frame, model: model[[1, 0, 2]], neighbour=neighbour)[0] == 0
    assert outcome(lambda frame, model: model, neighbour=neighbour)[:2] == (NONE, 0)


@pytest.mark.parametrize("factor", [(1.0, 1.0), (0.7, 1.3), (1.3, 0.7)])
def test_joints_that_move_alike_are_slow_for_a_while_and_not_asked(factor: tuple[float, float]) -> None:
    """Fails when two joints that move alike lose their slow rise at once, never lose it, or are asked."""
    scale = np.array([*factor, 1.0])
    pair, questions, soon = outcome(lambda frame, model: scale * model, ALIKE_S, neighbour=1.0)
    assert (pair, questions) == (NONE, 0)
    assert soon <= CAUTION_PA_PER_S * ALIKE_S
    assert outcome(lambda frame, model: scale * model, neighbour=1.0) == (NONE, 0, 1e5)


def test_a_question_lets_a_joint_fall_a_little() -> None:
    """Fails when a question empties a joint: it keeps half of its pressure once it is to have fallen enough."""
    watch = PlaceWatch(np.array([-1]))
    watch.start(np.zeros(1))
    watch.state[0] = 0.0  # it has moved as asked before
    command = np.array([8e4])
    hold_places(watch.state, command, np.array([8e4]), DT)
    watch.state[_STATE] = _ANSWERS
    hold_places(watch.state, command, np.array([7e4]), DT)
    assert command[0] == 0.0
    watch.state[_STATE], command[0] = _STAYS, 8e4
    hold_places(watch.state, command, np.array([2e4]), DT)
    assert command[0] == pytest.approx(4e4)


@pytest.mark.parametrize("apart_deg", [0.0, 0.4])
def test_an_exchange_at_rest_in_one_pose_is_found_in_the_next_motion(apart_deg: float) -> None:
    """Fails when sensors that are exchanged after they were proven, where this makes no step, are believed for ever."""
    apart = np.radians([0.0, apart_deg, 0.0])
    again = round(3.0 / DT)

    def measured(frame: int, model: Array) -> Array:
        angles: Array = model + apart
        return angles if frame < again else angles[[1, 0, 2]]

    def asked_pa(frame: int) -> float:
        return 1e5 if frame < round(2.0 / DT) or frame > again + 10 else 0.0

    assert outcome(measured, 6.0, asked_pa)[:2] == (0, QUESTIONS)
    assert outcome(lambda frame, model: model + apart, 6.0, asked_pa)[:2] == (NONE, 0)


@pytest.mark.parametrize("factor", [0.55, 1.0, 1.8])
def test_a_hand_as_wired_is_neither_asked_nor_slow(factor: float) -> None:
    """Fails when a right hand whose model is 30 % off is asked, or does not get its pressure."""
    pair, questions, highest = outcome(lambda frame, model: factor * model)
    assert (pair, questions) == (NONE, 0)
    assert highest == 1e5


@pytest.mark.parametrize("begin_s", [0.0, 0.1, 0.2, 0.4])
@pytest.mark.parametrize("push_s", [0.2, 0.4, 0.6, 0.8, 1.0, 1.5])
def test_a_push_next_to_a_blocked_joint_is_no_exchange(push_s: float, begin_s: float) -> None:
    """Fails when a push on one joint, which may look like an answer once, latches a fault."""

    def pushed(frame: int, model: Array) -> Array:
        share = (frame * DT - begin_s) / push_s
        return np.array([0.0, 0.2 * np.sin(np.pi * share) ** 2 if 0.0 < share < 1.0 else 0.0, 0.0])

    pair, _, _ = outcome(pushed)
    assert pair == NONE


def test_the_first_rise_is_slow() -> None:
    """Fails when a joint that has not yet moved gets a set-point at once."""
    watch = PlaceWatch(np.array([-1]))
    watch.start(np.zeros(1))
    command = np.array([3e5])
    assert hold_places(watch.state, command, np.zeros(1), DT)
    assert command[0] == pytest.approx(CAUTION_PA_PER_S * DT)


def test_no_set_point_is_negative() -> None:
    """Fails when noise below ambient pressure at arming reaches a valve, which the driver refuses."""
    start, low = np.full(len(HAND.joints), -150.0), np.full(len(HAND.joints), 0.1)
    watch = SensorWatch(HAND)
    watch.start(low, np.zeros(len(low)), start)
    places = PlaceWatch(np.full(len(low), -1, dtype=np.int64))
    places.start(start)
    for _ in range(3):
        watch.check(low, start, np.zeros(len(low)), np.zeros(len(low)), DT)
        command, placed = np.full(len(low), 2e5), np.full(len(low), 2e5)
        watch.hold(command)
        hold_places(places.state, placed, start, 0.0)
        assert command.min() >= 0.0
        assert placed.min() >= 0.0


@pytest.mark.parametrize("state", [_ANSWERS, _WAITS])
def test_no_question_is_negative(state: int) -> None:
    """Fails when a question asks for the noise of a sensor, below ambient pressure."""
    watch = PlaceWatch(np.array([-1]))
    watch.start(np.full(1, -150.0))
    watch.state[_STATE] = state
    command = np.array([2e5])
    hold_places(watch.state, command, np.full(1, -150.0), DT)
    assert command[0] == 0.0


@pytest.mark.parametrize("motion", ["step", "opposed", "all joints"])
def test_exchanged_sensors_move_no_joint_far(motion: str) -> None:
    """Fails when the whole controller drives a joint by more than 5 degrees on the angle of its neighbour."""
    print("seed 77")
    (found,) = study(HAND, [Case(0.1, motion, 6, "angles exchanged", True)], 77)
    assert found.error_deg < 5.0
    assert found.excess_pa < 5e4
