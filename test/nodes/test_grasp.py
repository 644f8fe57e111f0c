"""The grasp action over DDS: closing on something, on nothing, cancel, preemption, refusal, venting."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from action_msgs.msg import GoalStatus
from hand_msgs.action import Grasp
from hand_msgs.msg import Contact

if TYPE_CHECKING:
    from test.nodes.stack import Client, Stack

OBSTACLE = "  contact: {angle_deg: 35, stiffness_nm_per_rad: 1.0}\n"


class Grasper:
    """A client of the action, as a user's node would hold it."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.feedback: list[Any] = []
        self.contacts: list[Any] = []
        self.action = client.action(Grasp, "grasp")
        client.node.create_subscription(Contact, "contacts", self.contacts.append, 50)
        client.until(self.action.server_is_ready)

    def send(self, pattern: str, closure: float = 1.0, max_torque: float = 0.1) -> Any:
        goal = Grasp.Goal(pattern=pattern, closure=closure, max_torque=max_torque)
        future = self.action.send_goal_async(goal, feedback_callback=lambda m: self.feedback.append(m.feedback))
        self.client.until(future.done)
        return future.result()

    def result(self, handle: Any) -> Any:
        future = handle.get_result_async()
        self.client.until(future.done)
        return future.result()


def started(stack: Stack, client: Client, obstacle: bool) -> Grasper:
    text = Path("config/hand.yaml").read_text(encoding="utf-8")
    hand = stack.folder / "hand.yaml"
    hand.write_text(text.replace("joint_defaults:\n", "joint_defaults:\n" + OBSTACLE * obstacle), encoding="utf-8")
    stack.node("simulation", hand_description=hand)
    stack.node("controller")
    client.controlling()
    return Grasper(client)


def test_closes_on_a_thing_and_holds_the_torque(stack: Stack, client: Client) -> None:
    """Fails when the hand does not stop at an obstacle, or holds another torque than the wanted one."""
    grasper = started(stack, client, obstacle=True)
    handle = grasper.send("cylindrical", max_torque=0.1)
    assert handle.accepted
    result = grasper.result(handle)
    assert result.status == GoalStatus.STATUS_SUCCEEDED, result.result.message
    held = dict(zip(result.result.name, result.result.contact, strict=True))
    assert held["index_proximal"] and held["middle_distal"], held
    state = client.states[-1]
    for name, torque, touching in zip(state.name, state.torque_estimate, held.values(), strict=True):
        if touching:
            assert torque == pytest.approx(0.1, rel=0.1), name
    assert grasper.feedback and 0.0 <= grasper.feedback[0].progress <= 1.0
    begun = [event for event in grasper.contacts if event.touching]
    assert {event.name for event in begun} >= {"index_proximal", "middle_distal"}
    assert all(0.0 <= event.delay < 0.5 and event.source for event in begun)
    grasper.result(grasper.send("open"))
    client.until(lambda: client.angle("index_proximal") < math.radians(10.0))


def test_nothing_in_the_hand_cancel_preempt_refuse_vent(stack: Stack, client: Client) -> None:
    """Fails when a grasp of nothing claims contact, or a goal does not end as requested."""
    grasper = started(stack, client, obstacle=False)
    result = grasper.result(grasper.send("tripod"))
    assert result.status == GoalStatus.STATUS_SUCCEEDED
    assert not any(result.result.contact) and result.result.message.startswith("0 joints")

    handle = grasper.send("open")
    cancelled = handle.cancel_goal_async()
    client.until(cancelled.done)
    assert grasper.result(handle).status == GoalStatus.STATUS_CANCELED

    first = grasper.send("cylindrical")
    second = grasper.send("hook")
    ended = grasper.result(first)
    assert ended.status == GoalStatus.STATUS_ABORTED and "preempted by another grasp" in ended.result.message
    client.command(index_proximal=0.3)
    ended = grasper.result(second)
    assert ended.status == GoalStatus.STATUS_ABORTED and "preempted by joint_commands" in ended.result.message

    assert not grasper.send("fist").accepted
    client.until_said("controller", "commands", "pattern is 'fist'; it must be one of")
    assert not grasper.send("hook", closure=1.5).accepted
    assert not grasper.send("hook", max_torque=9.0).accepted

    last = grasper.send("cylindrical")
    client.trigger("vent")
    ended = grasper.result(last)
    assert ended.status == GoalStatus.STATUS_ABORTED and "vented" in ended.result.message
    assert not grasper.send("hook").accepted


def test_goals_in_quick_succession_end_each_in_its_own_way(stack: Stack, client: Client) -> None:
    """Fails when a preempted goal reports success, or a cancel ends another goal than its own."""
    grasper = started(stack, client, obstacle=False)

    def sent(*patterns: str) -> list[Any]:
        goals = [Grasp.Goal(pattern=pattern, closure=0.5, max_torque=0.1) for pattern in patterns]
        futures = [grasper.action.send_goal_async(goal) for goal in goals]
        client.until(lambda: all(future.done() for future in futures))
        return [future.result() for future in futures]

    handles = sent("cylindrical", "hook", "tripod", "lateral", "open")
    ended = [grasper.result(handle) for handle in handles]
    assert [end.status for end in ended] == [GoalStatus.STATUS_ABORTED] * 4 + [GoalStatus.STATUS_SUCCEEDED]
    assert all("preempted by another grasp" in end.result.message for end in ended[:4])

    first, second = sent("cylindrical", "hook")
    for handle in (first, second):
        cancelled = handle.cancel_goal_async()
        client.until(cancelled.done)
        if handle is first:
            client.spin(0.3)
            assert second.status not in (GoalStatus.STATUS_CANCELING, GoalStatus.STATUS_CANCELED)
    assert grasper.result(first).status == GoalStatus.STATUS_ABORTED
    assert grasper.result(second).status == GoalStatus.STATUS_CANCELED
