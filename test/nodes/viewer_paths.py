"""The signals that the layouts of Foxglove and PlotJuggler show, looked up in messages of running nodes or of a bag."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader

LAYOUTS = Path("config/layouts")
COUNT = 66
"""Signals of a layout: 11 angles, references, pressures, set-points, forces and contacts each."""
LEVELS = 5
"""Levels of diagnostics in the layout of PlotJuggler."""
NUMBER = (float, bool, np.bool_)
DIAGNOSTICS = "/diagnostics"


def newest_of(recording: Path) -> dict[str, Any]:
    """The last message of each topic of a recording, read by rosbags, which writes none of ours."""
    newest, statuses = {}, []
    with AnyReader([recording]) as bag:
        for connection, _, raw in bag.messages():
            newest[connection.topic] = (raw, connection.msgtype)
            if connection.topic == DIAGNOSTICS:
                message: Any = bag.deserialize(raw, connection.msgtype)
                statuses += message.status
        found = {topic: bag.deserialize(*each) for topic, each in newest.items()}
    return found | ({DIAGNOSTICS: joined(statuses)} if statuses else {})


def joined(statuses: Iterable[Any]) -> SimpleNamespace:
    """The last status of each name, as one message; every node publishes its own."""
    return SimpleNamespace(status=list({status.name: status for status in statuses}.values()))


def check_foxglove(received: dict[str, Any], without: tuple[str, ...] = ()) -> None:
    """Every path is a number of a message, and the 3-D hand has the joints that move it.

    received: messages by topic.  without: topics that are not there, as without a controller.
    """
    panels = json.loads((LAYOUTS / "hand.foxglove.json").read_text(encoding="utf-8"))["configById"]
    paths = [path["value"] for panel in panels.values() for path in panel.get("paths", [])]
    assert len(paths) == COUNT
    for path in paths:
        topic, field, index = re.fullmatch(r"(/[\w/]+)\.(\w+)\[(\d+)\]", path).groups()  # type: ignore[union-attr]
        assert topic in without or isinstance(getattr(received[topic], field)[int(index)], NUMBER), path
    layer = panels["3D!hand"]["layers"]["hand"]
    assert layer["sourceType"] == "topic"
    urdf = ET.fromstring(received[layer["topic"]].data)
    turning = {joint.get("name") for joint in urdf.iter("joint") if joint.get("type") == "revolute"}
    assert turning == set(received[layer["jointStatesTopic"]].name)
    assert panels["3D!hand"]["followTf"] in {link.get("name") for link in urdf.iter("link")}
    assert panels["DiagnosticSummary!hand"]["topicToRender"] == DIAGNOSTICS
    assert DIAGNOSTICS in without or received[DIAGNOSTICS].status


def check_plotjuggler(received: dict[str, Any]) -> None:
    """Every series is a number of a message; PlotJuggler writes the joint of a JointState into the path."""
    series = [str(curve.get("name")) for curve in ET.parse(LAYOUTS / "hand.plotjuggler.xml").getroot().iter("curve")]
    assert len(series) == COUNT + LEVELS
    for name in series[COUNT:]:
        values = {
            f"{DIAGNOSTICS}/{status.hardware_id}/{status.name}/{each.key}": each.value
            for status in received[DIAGNOSTICS].status
            for each in status.values
        }
        assert float(values[name]) in (0.0, 1.0, 2.0, 3.0), name
    for name in series[:COUNT]:
        topic, last = name.rsplit("/", 1)
        match = re.fullmatch(r"(\w+)\[(\d+)\]", last)
        if match:
            assert isinstance(getattr(received[topic], match[1])[int(match[2])], NUMBER), name
        else:
            topic, joint = topic.rsplit("/", 1)
            state = received[topic]
            assert isinstance(getattr(state, last)[list(state.name).index(joint)], float), name
