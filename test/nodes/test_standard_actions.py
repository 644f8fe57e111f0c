"""follow_joint_trajectory and gripper_cmd over DDS, with the fields of control_msgs, from another process."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory, GripperCommand
from control_msgs.msg import JointTolerance
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

if TYPE_CHECKING:
    from test.nodes.stack import Client, Stack

CODES = FollowJointTrajectory.Result
OBSTACLE = "  contact: {angle_deg: 35, stiffness_nm_per_rad: 1.0}\n"


class Caller:
    """A client of one action, as MoveIt would hold it."""

    def __init__(self, client: Client, kind: Any, name: str) -> None:
        self.client, self.feedback = client, []  # type: ignore[var-annotated]
        self.action = client.action(kind, name)
        client.until(self.action.server_is_ready)

    def send(self, goal: Any) -> Any:
        future = self.action.send_goal_async(goal, feedback_callback=lambda m: self.feedback.append(m.feedback))
        self.client.until(future.done)
        return future.result()

    def result(self, handle: Any) -> Any:
        future = handle.get_result_async()
        self.client.until(future.done)
        return future.result()

    def cancel(self, handle: Any) -> None:
        future = handle.cancel_goal_async()
        self.client.until(future.done)


def trajectory(seconds: float, **angles: float) -> FollowJointTrajectory.Goal:
    point = JointTrajectoryPoint(positions=list(angles.values()))
    point.time_from_start.sec, point.time_from_start.nanosec = divmod(round(seconds * 1e9), 1_000_000_000)
    return FollowJointTrajectory.Goal(trajectory=JointTrajectory(joint_names=list(angles), points=[point]))


def tolerances(size: float, *names: str) -> list[JointTolerance]:
    return [JointTolerance(name=name, position=size) for name in names]


def test_goals_of_follow_joint_trajectory_end_as_its_definition_says(stack: Stack, client: Client) -> None:
    """Fails when a goal does not reach, or ends with another status or error code than its definition names."""
    stack.node("simulation")
    stack.node("controller")
    client.controlling()
    caller = Caller(client, FollowJointTrajectory, "follow_joint_trajectory")

    goal = trajectory(0.5, index_proximal=0.8, thumb_distal=0.5)  # a part of the joints, in an order of its own
    goal.goal_tolerance = tolerances(0.05, "index_proximal", "thumb_distal")
    handle = caller.send(goal)
    ended = caller.result(handle)
    assert (ended.status, ended.result.error_code) == (GoalStatus.STATUS_SUCCEEDED, CODES.SUCCESSFUL)
    client.spin(0.3)  # the frame by which the goal ended may come after its result
    assert client.angle("index_proximal") == pytest.approx(0.8, abs=0.06)
    assert len(caller.feedback) > 5
    shown = caller.feedback[-1]
    assert shown.joint_names == ["index_proximal", "thumb_distal"] and shown.header.frame_id == "palm"
    assert shown.actual.positions[0] + shown.error.positions[0] == pytest.approx(shown.desired.positions[0])

    floating = trajectory(0.5, index_proximal=0.1)
    floating.multi_dof_trajectory.joint_names = ["base"]
    for wrong, code, part in (
        (floating, CODES.INVALID_GOAL, "multi_dof_trajectory is given"),
        (trajectory(0.5, nose=0.1), CODES.INVALID_JOINTS, "unknown joint 'nose'"),
        (trajectory(0.5, index_proximal=9.0), CODES.INVALID_GOAL, "the allowed range is"),
        (FollowJointTrajectory.Goal(), CODES.INVALID_JOINTS, "no joint is named"),
    ):
        ended = caller.result(caller.send(wrong))
        assert (ended.status, ended.result.error_code) == (GoalStatus.STATUS_ABORTED, code)
        assert part in ended.result.error_string and "\n" not in ended.result.error_string
    old = trajectory(0.5, index_proximal=0.5)
    old.trajectory.header.stamp.sec = 1
    assert caller.result(caller.send(old)).result.error_code == CODES.OLD_HEADER_TIMESTAMP

    fast = trajectory(0.05, index_proximal=0.1)
    fast.path_tolerance = tolerances(0.02, "index_proximal")
    ended = caller.result(caller.send(fast))
    assert (ended.status, ended.result.error_code) == (GoalStatus.STATUS_ABORTED, CODES.PATH_TOLERANCE_VIOLATED)
    exact = trajectory(0.3, index_proximal=0.6)
    exact.goal_tolerance = tolerances(1e-9, "index_proximal")
    exact.goal_time_tolerance.nanosec = 100_000_000
    ended = caller.result(caller.send(exact))
    assert (ended.status, ended.result.error_code) == (GoalStatus.STATUS_ABORTED, CODES.GOAL_TOLERANCE_VIOLATED)

    handle = caller.send(trajectory(3.0, index_proximal=1.5))
    client.spin(0.3)
    caller.cancel(handle)
    assert caller.result(handle).status == GoalStatus.STATUS_CANCELED
    client.spin(0.3)
    assert client.angle("index_proximal") < 1.2

    first = caller.send(trajectory(3.0, index_proximal=0.2))
    second = caller.send(trajectory(3.0, index_proximal=0.4))
    other = caller.send(trajectory(0.4, ring_distal=0.4))
    ended = caller.result(first)
    assert ended.status == GoalStatus.STATUS_ABORTED and "preempted" in ended.result.error_string
    assert caller.result(other).status == GoalStatus.STATUS_SUCCEEDED
    client.trigger("vent")
    ended = caller.result(second)
    assert ended.status == GoalStatus.STATUS_ABORTED and "vented" in ended.result.error_string
    ended = caller.result(caller.send(trajectory(0.4, ring_distal=0.4)))
    assert ended.result.error_code == CODES.INVALID_GOAL and "not being controlled" in ended.result.error_string


def test_gripper_cmd_closes_on_a_thing_and_opens(stack: Stack, client: Client) -> None:
    """Fails when a gripper that holds a thing reports the goal as reached, or an open hand reports contact.

    The hand has a prefix: it fails, too, when driver and controller disagree on the names of joints or frames.
    """
    text = Path("config/hand.yaml").read_text(encoding="utf-8")
    hand = stack.folder / "hand.yaml"
    hand.write_text(text.replace("joint_defaults:\n", "joint_defaults:\n" + OBSTACLE), encoding="utf-8")
    for node in ("simulation", "controller"):
        stack.node(node, hand_description=hand, joint_prefix="left_")
    client.controlling()
    state = client.states[-1]
    assert state.header.frame_id == client.joints[-1].header.frame_id == "left_palm"
    assert all(name.startswith("left_") for name in [*state.name, *client.joints[-1].name])
    caller = Caller(client, GripperCommand, "gripper_cmd")
    goal = GripperCommand.Goal()
    goal.command.position, goal.command.max_effort = 1.0, 0.1
    ended = caller.result(caller.send(goal))
    assert ended.status == GoalStatus.STATUS_SUCCEEDED
    held = ended.result
    assert held.stalled and not held.reached_goal
    assert 0.4 < held.position < 0.9 and held.effort == pytest.approx(0.1, rel=0.2)
    assert caller.feedback

    goal.command.position, goal.command.max_effort = 0.0, 0.0
    ended = caller.result(caller.send(goal))
    assert ended.status == GoalStatus.STATUS_SUCCEEDED
    assert ended.result.reached_goal and not ended.result.stalled
    assert ended.result.position == pytest.approx(0.0, abs=0.1)
    assert client.angle("left_index_proximal") < math.radians(10.0)

    goal.command.position = 1.5
    assert not caller.send(goal).accepted
    client.until_said("controller", "commands", "gripper_cmd refused: closure is 1.5; the allowed range is 0 to 1")
    goal.command.position = 1.0
    handle = caller.send(goal)
    caller.cancel(handle)
    assert caller.result(handle).status == GoalStatus.STATUS_CANCELED
