"""How a program leaves the ROS graph before it ends."""

from __future__ import annotations

from typing import Protocol

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node


class Destroyed(Protocol):
    """What a node does not destroy by itself, such as an ActionClient."""

    def destroy(self) -> None:
        """Free what it holds of the node."""


def leave_graph(node: Node, executor: EventsExecutor, *besides: Destroyed) -> None:
    """End the node, its executor, what it does not destroy itself, and ROS in this program.

    The executor comes first. It holds what it has executed, and with it the DDS participant; Fast DDS would then end
    the participant after the program, from a static destructor, where a discovery at that moment is a segmentation
    fault and not an exit code.
    """
    executor.shutdown()
    for each in besides:
        each.destroy()
    node.destroy_node()
    rclpy.try_shutdown()
