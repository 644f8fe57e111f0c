"""The signals that the layouts of Foxglove and PlotJuggler show, looked up in messages of running nodes."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

LAYOUTS = Path("config/layouts")
COUNT = 66
"""Signals of a layout: 11 angles, references, pressures, set-points, forces and contacts each."""


def check_foxglove(received: dict[str, Any], topics: set[str]) -> None:
    """Every path is a number of a message. received: messages by topic.  topics: all of the graph."""
    panels = json.loads((LAYOUTS / "hand.foxglove.json").read_text(encoding="utf-8"))["configById"]
    paths = [path["value"] for panel in panels.values() for path in panel.get("paths", [])]
    assert len(paths) == COUNT
    for path in paths:
        topic, field, index = re.fullmatch(r"(/[\w/]+)\.(\w+)\[(\d+)\]", path).groups()  # type: ignore[union-attr]
        assert isinstance(getattr(received[topic], field)[int(index)], float | bool), path
    others = {
        panels["DiagnosticSummary!hand"]["topicToRender"],
        panels["3D!hand"]["layers"]["hand"]["jointStatesTopic"],
    }
    assert others <= topics


def check_plotjuggler(received: dict[str, Any]) -> None:
    """Every series is a number of a message; PlotJuggler writes the joint of a JointState into the path."""
    series = [str(curve.get("name")) for curve in ET.parse(LAYOUTS / "hand.plotjuggler.xml").getroot().iter("curve")]
    assert len(series) == COUNT
    for name in series:
        topic, last = name.rsplit("/", 1)
        match = re.fullmatch(r"(\w+)\[(\d+)\]", last)
        if match:
            assert isinstance(getattr(received[topic], match[1])[int(match[2])], float | bool), name
        else:
            topic, joint = topic.rsplit("/", 1)
            state = received[topic]
            assert isinstance(getattr(state, last)[list(state.name).index(joint)], float), name
