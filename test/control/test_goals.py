"""Goals of follow_joint_trajectory without ROS: tolerances, codes, and how each goal ends."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hand_control.command_check import Points, check_trajectory
from hand_control.controller import Controller, Times
from hand_control.declared import Settings
from hand_control.goals import (
    Code,
    GoalLimits,
    GoalRefusedError,
    RunningGoals,
    TrajectoryGoal,
    check_fields,
    check_names_and_age,
    check_size,
    read_tolerances,
)
from hand_messages.commands import MAX_POINTS
from hand_model.description import load_hand
from hand_model.kernel.layout import OMEGA, PHI, P
from hand_sim.plant import HandPlant

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
COUNT = len(HAND.joints)
S = 1_000_000_000
NAMES = ("index_proximal", "thumb_distal")
INDEX = [HAND.joints.index(name) for name in NAMES]


def tolerance(name: str, position: float = 0.0, velocity: float = 0.0) -> Any:
    return SimpleNamespace(name=name, position=position, velocity=velocity, acceleration=0.0)


def goal(path: float = 0.0, at_goal: float = 0.0, goal_time_s: float = 1.0, velocity: float = 0.0) -> TrajectoryGoal:
    """A goal of one second from now on, with the same tolerances for both joints."""
    points: Points = [(0.0, [0.1, 0.2], []), (1.0, [0.5, 0.6], [])]
    trajectory = check_trajectory(HAND, NAMES, points, 0, 10 * S)
    made = [read_tolerances(NAMES, [tolerance(name, size, v) for name in NAMES], 0.0)
            for size, v in ((path, 0.0), (at_goal, velocity))]  # fmt: skip
    return TrajectoryGoal(HAND, trajectory, GoalLimits(made[0], made[1], goal_time_s))


def full(first: float, second: float) -> np.ndarray:
    values = np.full(COUNT, np.nan)  # the other joints must not matter
    values[INDEX] = first, second
    return values


def step(made: TrajectoryGoal, seconds: float, reference: np.ndarray, position: np.ndarray, speed: float = 0.0) -> None:
    made.step(10 * S + round(seconds * S), (reference, full(0.0, 0.0)), (position, full(speed, speed)))


def test_tolerances_are_those_of_the_goal_else_of_the_setting() -> None:
    """Fails when 0 does not stand for the setting, a negative value not for none, or a joint gets another's value."""
    found = read_tolerances(NAMES, [tolerance("thumb_distal", 0.3, 0.5)], 2.0)
    np.testing.assert_allclose(found.position_rad, [math.radians(2.0), 0.3])
    np.testing.assert_allclose(found.velocity_rad_s, [math.inf, 0.5])
    found = read_tolerances(NAMES, [tolerance("thumb_distal", -1.0), tolerance("index_proximal")], 2.0)
    np.testing.assert_allclose(found.position_rad, [math.radians(2.0), math.inf])
    assert np.isinf(read_tolerances(NAMES, [], 0.0).position_rad).all()


BAD = {
    "joint": (tolerance("ring_distal", 0.1), Code.INVALID_JOINTS, "'ring_distal'"),
    "nan": (tolerance("thumb_distal", math.nan), Code.INVALID_GOAL, "position tolerance of thumb_distal is nan"),
    "inf": (tolerance("thumb_distal", 0.1, math.inf), Code.INVALID_GOAL, "velocity tolerance of thumb_distal is inf"),
}


@pytest.mark.parametrize("case", BAD.values(), ids=BAD)
def test_bad_tolerances_are_refused_with_a_code(case: tuple[Any, Code, str]) -> None:
    """Fails when a tolerance for another joint, or one that is not finite, is taken."""
    given, code, part = case
    with pytest.raises(GoalRefusedError, match=part) as caught:
        read_tolerances(NAMES, [given], 0.0)
    assert caught.value.code is code


def test_names_and_age_have_codes_of_their_own() -> None:
    """Fails when an unknown or repeated joint, no joint, or an old stamp gets another code."""
    for names, stamp_ns, code in (
        (["index_proximal", "nose"], 0, Code.INVALID_JOINTS),
        (["index_proximal", "index_proximal"], 0, Code.INVALID_JOINTS),
        ([], 0, Code.INVALID_JOINTS),
        (list(NAMES), 9 * S, Code.OLD_HEADER_TIMESTAMP),
    ):
        with pytest.raises(GoalRefusedError) as caught:
            check_names_and_age(HAND, names, stamp_ns, 10 * S)
        assert caught.value.code is code and "\n" not in str(caught.value)
    check_names_and_age(HAND, NAMES, round(9.8 * S), 10 * S)


def test_what_a_hand_cannot_follow_is_refused() -> None:
    """Fails when joints of several degrees of freedom are silently ignored, or tolerances without number are read."""
    check_fields({"multi_dof_trajectory": []})
    with pytest.raises(GoalRefusedError, match="multi_dof_trajectory is given") as caught:
        check_fields({"component_path_tolerance": [], "multi_dof_trajectory": ["base"]})
    assert caught.value.code is Code.INVALID_GOAL
    with pytest.raises(GoalRefusedError, match="2000 tolerances; at most"):
        read_tolerances(NAMES, [tolerance("thumb_distal")] * 2000, 0.0)


def test_a_goal_with_too_many_points_is_refused() -> None:
    """Fails when a goal of more points than are read is not refused, or not in one line with the limit."""
    check_size(MAX_POINTS)
    with pytest.raises(GoalRefusedError, match=f"^goal refused: it has {MAX_POINTS + 1} points; at most {MAX_POINTS} "):
        check_size(MAX_POINTS + 1)


def test_the_path_is_compared_with_the_reference_and_only_until_the_end() -> None:
    """Fails when an error inside the tolerance aborts, one outside does not, or the path counts before the start."""
    made = goal(path=0.1)
    step(made, -0.5, full(9.0, 9.0), full(0.0, 0.0))
    step(made, 0.5, full(0.3, 0.4), full(0.21, 0.49))
    assert made.end is None
    step(made, 0.6, full(0.3, 0.4), full(0.3, 0.51))
    assert made.end is not None and made.end[0] is Code.PATH_TOLERANCE_VIOLATED
    assert "thumb_distal is off the path by 0.1100 rad" in made.end[1]
    made = goal(path=0.1)
    step(made, 1.1, full(0.5, 0.6), full(0.0, 0.0))
    assert made.end == (Code.SUCCESSFUL, "every joint is within its tolerance of the goal")


def test_the_goal_is_waited_for_and_then_violated() -> None:
    """Fails when a goal is not waited for, is waited for too long, or a moving joint counts as arrived."""
    made = goal(at_goal=0.05, goal_time_s=0.5, velocity=0.2)
    step(made, 1.2, full(0.5, 0.6), full(0.5, 0.5))
    step(made, 1.3, full(0.5, 0.6), full(0.5, 0.6), speed=0.3)
    assert made.end is None
    step(made, 1.4, full(0.5, 0.6), full(0.46, 0.64), speed=0.1)
    assert made.end is not None and made.end[0] is Code.SUCCESSFUL
    made = goal(at_goal=0.05, goal_time_s=0.5)
    step(made, 1.51, full(0.5, 0.6), full(0.5, 0.5))
    assert made.end is not None and made.end[0] is Code.GOAL_TOLERANCE_VIOLATED
    assert "thumb_distal is not at the goal by 0.1000 rad, 0.0500 rad are allowed" in made.end[1]
    made = goal(at_goal=0.05, goal_time_s=math.inf)
    step(made, 3000.0, full(0.5, 0.6), full(0.5, 0.5))
    assert made.end is None


def test_a_clock_that_is_set_back_ends_the_goal() -> None:
    """Fails when a goal waits for a time of a clock that no longer exists."""
    made = goal()
    step(made, 0.5, full(0.3, 0.4), full(0.3, 0.4))
    step(made, -3.0, full(0.3, 0.4), full(0.3, 0.4))
    assert made.end == (Code.INVALID_GOAL, "the clock was set back")


def test_a_command_ends_the_goals_of_its_joints_alone() -> None:
    """Fails when a goal of other joints ends, or an ended goal ends a second time for another reason."""
    running, first, second = RunningGoals(), goal(), goal()
    second.index = np.array([0])
    running.add(first)
    running.add(second)
    running.end("preempted", np.array([INDEX[1], 9]))
    assert first.end == (Code.INVALID_GOAL, "preempted") and second.end is None
    running.end("vented")
    assert first.end == (Code.INVALID_GOAL, "preempted") and second.end == (Code.INVALID_GOAL, "vented")


class Driven:
    """A controller on the simulated hand, in virtual time."""

    def __init__(self, **settings: Any) -> None:
        self.plant = HandPlant(HAND, 1.0 / HAND.rate_hz)
        self.controller = Controller(HAND, Settings.of(HAND, settings))
        self.controller.enable(True)
        self.now_ns = S
        self.run(0.2)

    def times(self) -> Times:
        return Times(0, self.now_ns, self.now_ns)

    def run(self, seconds: float) -> None:
        """Advance by some time [s]."""
        for _ in range(round(seconds * HAND.rate_hz)):
            self.now_ns += round(S / HAND.rate_hz)
            state = self.plant.state
            now = Times(self.now_ns, self.now_ns, self.now_ns)
            tick = self.controller.frame(now, state[PHI].copy(), state[OMEGA].copy(), state[P].copy())
            assert tick is not None
            self.plant.advance(tick.pressure_command[None])

    def follow(self, *points: tuple[float, float], goal_rad: float = 0.05, path_rad: float = 0.0) -> TrajectoryGoal:
        made: Points = [(seconds, [angle], []) for seconds, angle in points]
        allowed = [tolerance("index_proximal", path_rad)], [tolerance("index_proximal", goal_rad)]
        return self.controller.follow(self.times(), ["index_proximal"], made, allowed, 0.0)


def test_a_goal_of_one_joint_is_reached() -> None:
    """Fails when a goal of one joint does not reach its tolerance, or ends before the trajectory does."""
    driven = Driven()
    made = driven.follow((1.0, 0.8))
    driven.run(0.9)
    assert made.end is None
    driven.run(1.0)
    assert made.end is not None and made.end[0] is Code.SUCCESSFUL
    assert driven.plant.state[PHI][INDEX[0]] == pytest.approx(0.8, abs=0.05)


def test_a_path_that_cannot_be_followed_is_aborted_and_the_joint_holds() -> None:
    """Fails when an error on the path is not noticed, or the joint goes on to the goal afterwards."""
    driven = Driven()
    made = driven.follow((0.0, 0.1), (0.15, 1.5), path_rad=0.15)
    driven.run(0.3)
    assert made.end is not None and made.end[0] is Code.PATH_TOLERANCE_VIOLATED, made.end
    driven.run(1.0)
    assert driven.plant.state[PHI][INDEX[0]] < 1.2


def test_cancel_stops_the_joint_and_other_goals_go_on() -> None:
    """Fails when a cancelled goal moves on, or the cancel ends a goal of another joint."""
    driven = Driven()
    first = driven.follow((2.0, 1.2))
    other = driven.controller.follow(driven.times(), ["ring_distal"], [(1.0, [0.5], [])], ([], []), 0.0)
    driven.run(0.7)
    driven.controller.cancel(first)
    assert first.end == (Code.SUCCESSFUL, "cancelled on request") and other.end is None
    stopped = driven.plant.state[PHI][INDEX[0]]
    driven.run(1.5)
    assert abs(driven.plant.state[PHI][INDEX[0]] - stopped) < 0.2
    assert other.end is not None and other.end[0] is Code.SUCCESSFUL


def test_commands_grasps_and_vents_end_a_goal() -> None:
    """Fails when a goal survives what has taken its joints."""
    driven = Driven()
    made = driven.follow((2.0, 1.2))
    driven.controller.command(driven.times(), ["thumb_distal"], [0.4], [])
    assert made.end is None
    driven.controller.command(driven.times(), ["index_proximal"], [0.4], [])
    assert made.end == (Code.INVALID_GOAL, "preempted by joint_commands")
    made = driven.follow((2.0, 1.2))
    newer = driven.follow((2.0, 0.9))
    assert made.end == (Code.INVALID_GOAL, "preempted by another trajectory") and newer.end is None
    driven.controller.vent("vent was called")
    driven.run(0.02)
    assert newer.end == (Code.INVALID_GOAL, "the hand was vented: vent was called")
    with pytest.raises(GoalRefusedError, match="the hand is not being controlled") as caught:
        driven.follow((2.0, 0.9))
    assert caught.value.code is Code.INVALID_GOAL


def test_a_refused_goal_leaves_the_running_one_alone() -> None:
    """Fails when a goal with an angle outside the limits, or without points, takes the joint."""
    driven = Driven()
    made = driven.follow((2.0, 1.2))
    refused: tuple[Points, ...] = ([(1.0, [9.0], [])], [])
    for points in refused:
        with pytest.raises(GoalRefusedError, match=r"position is 9 rad; the allowed range|has no points"):
            driven.controller.follow(driven.times(), ["index_proximal"], points, ([], []), 0.0)
    assert made.end is None
