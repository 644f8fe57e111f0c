"""Commands as they arrive: bounded in bytes, entries and rate, then decoded. No ROS; times are arguments.

Messages of force sensors share the bound of their rate.
"""

from __future__ import annotations

from hand_messages.bounds import Budget
from hand_messages.commands import JointCommandMessage, TrajectoryMessage, read_joint_command, read_trajectory

TRAJECTORIES_HZ = 20.0
"""Trajectories a second that are read; one of 5,000 points delays a frame by several ms."""
GOALS_HZ = 20.0
"""Goals of each action a second that are answered after a check."""
BURST = 20
FORCES_HZ = 2000.0
"""Messages of force sensors a second that are read: those of a board of 1 kHz, and as many again."""


class CommandInputs:
    """Reads joint_commands and joint_trajectory, and counts what arrives too fast. now_s: a monotonic clock [s]."""

    def __init__(self, joints: int) -> None:
        """For a hand with this many joints."""
        self._joints = joints
        self._budgets = {
            "joint_commands": Budget(),
            "joint_trajectory": Budget(TRAJECTORIES_HZ, BURST),
            "contact_forces": Budget(FORCES_HZ),
            **{name: Budget(GOALS_HZ, BURST) for name in ("grasp", "follow_joint_trajectory", "gripper_cmd")},
        }

    def joint_command(self, raw: bytes, now_s: float) -> JointCommandMessage | None:
        """The message, or None where it is dropped unread. Raises ValueError, one line, where it is refused."""
        if not self.take("joint_commands", now_s):
            return None
        try:
            return read_joint_command(raw)
        except ValueError as error:
            raise ValueError(f"joint_commands refused: {error}") from None

    def trajectory(self, raw: bytes, now_s: float) -> TrajectoryMessage | None:
        """See joint_command."""
        if not self.take("joint_trajectory", now_s):
            return None
        try:
            return read_trajectory(raw, self._joints)
        except ValueError as error:
            raise ValueError(f"joint_trajectory refused: {error}") from None

    def take(self, topic: str, now_s: float) -> bool:
        """Whether another message of the topic is to be read."""
        return self._budgets[topic].take(now_s)

    def problem(self, now_s: float) -> str:
        """One line about topics whose messages were dropped unread lately; otherwise empty."""
        lines = [f"{topic}: {line}" for topic, budget in self._budgets.items() if (line := budget.problem(now_s))]
        return "; ".join(lines)
