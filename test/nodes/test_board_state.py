"""The topic `board_state` of real nodes: rate, the set-points in force, and the same from simulation and driver."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hand_msgs.msg import BoardState

if TYPE_CHECKING:
    from test.nodes.stack import Client, Stack


def test_the_simulation_reports_the_set_points_in_force(stack: Stack, client: Client) -> None:
    """Fails when the topic is missing, slower than 15 Hz, or its set-points are not those that were commanded."""
    states: list[BoardState] = []
    client.node.create_subscription(BoardState, "board_state", states.append, 10)
    stack.node("simulation")
    stack.node("controller", enabled_at_start=True)
    client.controlling()
    client.command(index_proximal=0.7)
    client.until(lambda: abs(client.angle("index_proximal") - 0.7) < 0.02)
    before = len(states)
    client.spin(2.0)
    assert len(states) - before >= 30
    last, sent = states[-1], client.valves[-1]
    assert (last.protocol, last.link_up, last.fault, last.status) == (2, True, "", 0)
    assert list(last.name) == list(sent.name)
    joint = list(sent.name).index("index_proximal")
    assert last.set_point[joint] == pytest.approx(sent.pressure[joint], abs=5e3)
    assert 0.0 < last.set_point_age < 0.1
    assert last.set_point_sequence > 100
