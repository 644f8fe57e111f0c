"""Goals whose size is checked before Python objects are made of them, on the requests that rclpy converts."""

from __future__ import annotations

import gc
import sys
import tracemalloc
from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("control_msgs", reason="control_msgs is not installed")

from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.type_support import check_for_type_support
from trajectory_msgs.msg import JointTrajectoryPoint

from hand_control import bounded_goals
from hand_control.bounded_goals import KEPT, GoalBounds
from hand_control.goals import Code, GoalRefusedError, check_size
from hand_messages.bounds import MAX_NAMES
from hand_messages.commands import MAX_POINTS

Request = FollowJointTrajectory.Impl.SendGoalService.Request
BYTES = 100_000
"""More than the objects of a refused request need, and far below those of a point for each entry."""


@pytest.fixture
def bounds() -> Iterator[GoalBounds]:
    check_for_type_support(FollowJointTrajectory)
    check_for_type_support(Request)
    before = type(Request)._CONVERT_TO_PY
    made = GoalBounds()
    assert made.install(FollowJointTrajectory)
    yield made
    type(Request)._CONVERT_TO_PY = before


def goal(points: int, values: int = 2, **lists: list[Any]) -> Any:
    request = Request()
    request.goal_id.uuid = [points % 251] * 16
    request.goal.trajectory.header.frame_id = "palm"
    request.goal.trajectory.joint_names = ["one", "two"]
    request.goal.trajectory.points = [JointTrajectoryPoint(positions=[0.5] * values)] * points
    for name, value in lists.items():
        setattr(request.goal, name, value)
    return request


@pytest.mark.parametrize("points", [0, 1, MAX_POINTS])
def test_a_goal_within_its_bounds_is_converted_whole(bounds: GoalBounds, points: int) -> None:
    """Fails when a value of an allowed goal is lost, its objects are kept for ever, or it is called too large."""
    request = goal(points, path_tolerance=[JointTolerance(name="one", position=0.1)])
    made = deserialize_message(serialize_message(request), Request)
    assert made == request
    assert bounds.refusal(bytes(made.goal_id.uuid)) == ""
    assert sys.getrefcount(made) == 2


def test_a_million_points_become_no_object(bounds: GoalBounds) -> None:
    """Fails when each point of a goal that is too large costs Python objects, or the goal is not named as too large."""
    raw = serialize_message(goal(1_000_000))
    gc.collect()
    tracemalloc.start()
    try:
        made = deserialize_message(raw, Request)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < BYTES
    assert len(made.goal.trajectory.points) == 0
    line = bounds.refusal(bytes(made.goal_id.uuid))
    assert line == f"it has 1000000 points; at most {MAX_POINTS} are allowed"
    assert bounds.refusal(bytes(made.goal_id.uuid)) == ""
    with pytest.raises(GoalRefusedError, match="goal refused: it has 1000000 points; at most 5000 are") as refused:
        check_size(len(made.goal.trajectory.points), line)
    assert refused.value.code is Code.INVALID_GOAL


@pytest.mark.parametrize(
    ("request_", "line"),
    [
        (goal(MAX_POINTS + 1), f"it has {MAX_POINTS + 1} points"),
        (goal(2, values=MAX_NAMES + 1), f"a point has a list of {MAX_NAMES + 1} values"),
        (goal(1, goal_tolerance=[JointTolerance()] * (MAX_NAMES + 1)), f"it has {MAX_NAMES + 1} goal_tolerance"),
    ],
)
def test_every_list_of_a_goal_has_a_bound(bounds: GoalBounds, request_: Any, line: str) -> None:
    """Fails when a goal may be large in another list than its points."""
    made = deserialize_message(serialize_message(request_), Request)
    assert bounds.refusal(bytes(made.goal_id.uuid)).startswith(line)


def test_refused_goals_that_nobody_asks_for_are_forgotten(bounds: GoalBounds) -> None:
    """Fails when a flood of large goals fills the memory with what they were refused for."""
    for k in range(KEPT + 5):
        request = goal(MAX_POINTS + 1)
        request.goal_id.uuid = [k] * 16
        deserialize_message(serialize_message(request), Request)
    known = [k for k in range(KEPT + 5) if bounds.refusal(bytes([k] * 16))]
    assert known == list(range(5, KEPT + 5))


def test_another_structure_is_left_to_rclpy(bounds: GoalBounds, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when sizes would be read where another generator of messages has something else."""
    monkeypatch.setattr(bounded_goals._Request, "path_tolerance", bounded_goals._Request.goal_tolerance)
    before = type(Request)._CONVERT_TO_PY
    assert not GoalBounds().install(FollowJointTrajectory)
    assert type(Request)._CONVERT_TO_PY is before


def test_a_large_goal_is_refused_without_a_bound_before_it() -> None:
    """Fails when a node whose requests are converted as usual makes a tuple of each point before it refuses them."""
    check_size(MAX_POINTS)
    with pytest.raises(GoalRefusedError, match="it has 5001 points; at most 5000 are allowed"):
        check_size(MAX_POINTS + 1)
