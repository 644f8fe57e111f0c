"""How a program joins the ROS graph, and how it leaves it before it ends."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from hand_ros.node import default_config
from hand_ros.transport import use_profiles


class Destroyed(Protocol):
    """What a node does not destroy by itself, such as an ActionClient."""

    def destroy(self) -> None:
        """Free what it holds of the node."""


def join_graph(args: Sequence[str] | None = None) -> None:
    """Start ROS in this program, with our profiles of Fast DDS unless the user has some; signals stay with the program.

    With these profiles programs of one machine find each other within a second; without, it may take three.
    args: ROS arguments; default: those of the command line.
    """
    use_profiles(Path(default_config("fastdds.xml")).parent, os.environ, Path.cwd())
    rclpy.init(args=None if args is None else list(args), signal_handler_options=SignalHandlerOptions.NO)


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
