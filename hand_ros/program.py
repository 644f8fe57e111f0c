"""The program of a node: from its start to its end by a signal."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from typing import NoReturn

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.task import Future

from hand_ros.graph import join_graph, leave_graph
from hand_ros.memory import lock_memory, return_large_blocks
from hand_ros.node import AUTOSTART, EXIT_UNCONFIGURED, HandNode, one_line

WHEN_TOLD = "FLUIDIC_HAND_START_WHEN_TOLD"
"""Environment variable: the program is read into memory, and joins the ROS graph when it receives a line."""


def run(make_node: Callable[[], HandNode], args: list[str] | None = None) -> int:
    """Run one node until SIGINT, SIGTERM or shutdown; the process's exit code.

    The node's finish runs in every case in which the process itself survives, so that the hand is vented.
    """
    if not _told_to_start():
        return 0
    stopped = Future()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set_result(None))
    return_large_blocks()
    lock_memory()
    try:
        join_graph(args)
        node = make_node()
    except Exception as error:  # rcl raises several unrelated classes for bad arguments
        print(f"cannot start: {one_line(error)}", file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    executor = EventsExecutor()
    executor.add_node(node)
    code = 0
    try:
        if node.get_parameter(AUTOSTART.name).value:
            if node.trigger_configure() == TransitionCallbackReturn.SUCCESS:
                node.trigger_activate()
            elif node.get_parameter(EXIT_UNCONFIGURED.name).value:
                code = 2
                stopped.set_result(None)
        while rclpy.ok() and not stopped.done():
            # The time is limited, because Python's signal handlers run between these calls only.
            executor.spin_until_future_complete(stopped, timeout_sec=0.1)
    finally:
        node.finish()
        leave_graph(node, executor)
    return code


def _told_to_start() -> bool:
    """Wait for a line on the standard input where whoever started this process wants that; False where it ends."""
    try:
        return WHEN_TOLD not in os.environ or bool(sys.stdin.readline())
    except KeyboardInterrupt:
        return False


def end(code: int) -> NoReturn:
    """End the process now with an exit code.

    `run` has vented the hand and left the network. What Python does besides, freeing compiled code, takes more time
    than a launch allows on a busy machine.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
