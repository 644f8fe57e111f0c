"""The layouts of Foxglove and PlotJuggler against the topics and messages of running nodes."""

from __future__ import annotations

import importlib
import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rclpy.qos import QoSProfile

if TYPE_CHECKING:
    from test.nodes.stack import Client, Stack

LAYOUTS = Path("config/layouts")


def test_every_path_of_the_layouts_is_a_number_of_a_running_hand(stack: Stack, client: Client) -> None:
    """Fails when a topic, field or joint of a layout does not exist, or an array is shorter than the layout says."""
    foxglove = json.loads((LAYOUTS / "hand.foxglove.json").read_text(encoding="utf-8"))["configById"]
    paths = [path["value"] for panel in foxglove.values() for path in panel.get("paths", [])]
    juggler = ET.parse(LAYOUTS / "hand.plotjuggler.xml").getroot()
    series = [str(curve.get("name")) for curve in juggler.iter("curve")]
    assert len(paths) == len(series) == 66
    stack.node("simulation")
    stack.node("controller")
    client.controlling()
    shown = {path.partition(".")[0] for path in paths}
    shown |= {foxglove["DiagnosticSummary!hand"]["topicToRender"]}
    shown |= {foxglove["3D!hand"]["layers"]["hand"]["jointStatesTopic"]}
    kinds = dict(client.node.get_topic_names_and_types())
    assert shown <= set(kinds)
    received: dict[str, Any] = {}
    for topic in shown:
        package, _, name = kinds[topic][0].split("/")
        kind = getattr(importlib.import_module(f"{package}.msg"), name)
        client.node.create_subscription(kind, topic, lambda m, t=topic: received.update({t: m}), QoSProfile(depth=5))
    client.until(lambda: set(received) == shown)
    for path in paths:
        topic, field, index = re.fullmatch(r"(/[\w/]+)\.(\w+)\[(\d+)\]", path).groups()  # type: ignore[union-attr]
        assert isinstance(getattr(received[topic], field)[int(index)], float | bool), path
    for name in series:
        topic, last = name.rsplit("/", 1)
        match = re.fullmatch(r"(\w+)\[(\d+)\]", last)
        if match:
            assert isinstance(getattr(received[topic], match[1])[int(match[2])], float | bool), name
        else:  # PlotJuggler writes the joint of a JointState into the path
            topic, joint = topic.rsplit("/", 1)
            state = received[topic]
            assert isinstance(getattr(state, last)[list(state.name).index(joint)], float), name
