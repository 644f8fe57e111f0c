"""Layouts of Foxglove and PlotJuggler and a configuration of RViz for the topics of one hand.

All three are made from the joints of the hand, so that a hand with other joints, another prefix or another namespace
has layouts of its own. Foxglove moves the 3-D hand by `joint_states`, so that it needs no TF and works on a recording.
"""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from hand_model.description import Hand
from hand_model.geometry import frame_prefix
from hand_model.yaml_document import yaml_text
from hand_robot.urdf import BASE
from hand_robot.xml_text import document

COLORS = (
    "#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#7f7f7f", "#b8a400", "#332288", "#117733",
    "#aa4499",
)  # fmt: skip
"""Colours that people with any colour vision can distinguish (Okabe and Ito; Tol), one per joint."""
LIGHT = 0.4
"""Brightness [0 to 1] from which a colour's shade is darker, and below which it is lighter."""
DIAGNOSTICS = "/diagnostics"
JOINT_STATES, PRESSURES, FORCES = "joint_states", "pressures", "contact_forces"
STATE, COMMAND, ROBOT = "controller_state", "valve_command", "robot_description"
STATUSES = ("safety", "board", "commands", "valves", "sensors")
"""Parts of the controller whose levels on /diagnostics PlotJuggler shows."""


@dataclass(frozen=True, slots=True)
class Curve:
    """An element of an array of a message. label: what it is.  color: of its line.  set_point: it is no measurement."""

    topic: str
    field: str
    index: int
    label: str
    color: str
    set_point: bool = False


def curves(hand: Hand, namespace: str) -> dict[str, list[Curve]]:
    """Curves of each plot: measured values in the colour of their joint, set-points in a shade of it."""
    space = f"/{namespace.strip('/')}/"

    def rows(topic: str, field: str, names: Iterable[str], note: str = "") -> list[Curve]:
        colored = zip(names, COLORS * (1 + len(hand.joints) // len(COLORS)), strict=False)
        made = ((i, f"{name} {note}".strip(), color) for i, (name, color) in enumerate(colored))
        return [
            Curve(space + topic, field, i, label, shade(color) if note else color, bool(note))
            for i, label, color in made
        ]

    return {
        "angles [rad]": [
            *rows(JOINT_STATES, "position", hand.joints),
            *rows(STATE, "reference", hand.joints, "reference"),
        ],
        "pressures [Pa]": [
            *rows(PRESSURES, "pressure", hand.joints),
            *rows(COMMAND, "pressure", hand.joints, "set-point"),
        ],
        "contact forces [N]": rows(FORCES, "force", hand.sensors.sites),
        "contacts": rows(STATE, "contact", hand.joints),
    }


def shade(color: str) -> str:
    """A colour, #rrggbb, halfway to black, or to white where it is dark; every reader sees the difference."""
    parts = [int(color[k : k + 2], 16) for k in (1, 3, 5)]
    brightness = sum(weight * part for weight, part in zip((0.2126, 0.7152, 0.0722), parts, strict=True)) / 255
    end = 0 if brightness >= LIGHT else 255
    return "#" + "".join(f"{(part + end) // 2:02x}" for part in parts)


def foxglove_text(hand: Hand, namespace: str = "hand") -> str:
    """A layout of Foxglove, JSON: 3-D hand, diagnostics, angles, pressures, forces, contacts."""
    plots = curves(hand, namespace)
    contacts = plots.pop("contacts")
    panels: dict[str, Any] = {"3D!hand": _hand_3d(hand, namespace), "DiagnosticSummary!hand": _diagnostics()}
    names = {title: f"Plot!{title.split()[0]}" for title in plots}
    panels |= {names[title]: _plot(title, plots[title]) for title in plots}
    panels["StateTransitions!contacts"] = {
        "paths": [
            {"value": _path(curve), "label": curve.label, "timestampMethod": "headerStamp"} for curve in contacts
        ],
        "isSynced": True,
    }
    right: Any = "StateTransitions!contacts"
    for share, title in zip((60, 55, 40), reversed(names.values()), strict=True):
        right = {"first": title, "second": right, "direction": "column", "splitPercentage": share}
    left = {"first": "3D!hand", "second": "DiagnosticSummary!hand", "direction": "column", "splitPercentage": 70}
    layout = {"first": left, "second": right, "direction": "row", "splitPercentage": 40}
    data = {"configById": panels, "globalVariables": {}, "userNodes": {}, "playbackConfig": {"speed": 1.0}}
    return json.dumps(data | {"layout": layout}, indent=1) + "\n"


def _path(curve: Curve) -> str:
    return f"{curve.topic}.{curve.field}[{curve.index}]"


def _plot(title: str, rows: list[Curve]) -> dict[str, Any]:
    paths = [
        {
            "value": _path(curve),
            "label": curve.label,
            "color": curve.color,
            "enabled": True,
            "timestampMethod": "headerStamp",
            "lineSize": 1 if curve.set_point else 2,
        }
        for curve in rows
    ]
    shown = {"showLegend": True, "legendDisplay": "left", "sidebarDimension": 180, "isSynced": True}
    return {"title": title, "paths": paths, "xAxisVal": "timestamp", "followingViewWidth": 20, **shown}


def _diagnostics() -> dict[str, Any]:
    return {
        "topicToRender": DIAGNOSTICS,
        "minLevel": 0,
        "pinnedIds": [],
        "hardwareIdFilter": "",
        "sortByLevel": True,
    }


def _hand_3d(hand: Hand, namespace: str) -> dict[str, Any]:
    space, base = f"/{namespace.strip('/')}", hand.prefix + BASE
    urdf = {
        "layerId": "foxglove.Urdf",
        "instanceId": "hand",
        "label": "hand",
        "visible": True,
        "frameLocked": True,
        "sourceType": "topic",
        "topic": f"{space}/{ROBOT}",
        "framePrefix": "",
        "controlMode": "jointStates",
        "jointStatesTopic": f"{space}/{JOINT_STATES}",
        "displayMode": "visual",
        "order": 2,
    }
    grid = {"layerId": "foxglove.Grid", "instanceId": "grid", "label": "Grid", "visible": True, "size": 0.4}
    camera = {"perspective": True, "distance": 0.45, "phi": 60, "thetaOffset": 45, "target": [0.08, 0, 0]}
    layers = {"hand": urdf, "grid": grid | {"divisions": 8, "frameLocked": True, "order": 1}}
    return {"followTf": base, "followMode": "follow-pose", "cameraState": camera, "layers": layers, "topics": {}}


def plotjuggler_text(hand: Hand, namespace: str = "hand") -> str:
    """A layout of PlotJuggler, XML: a tab for each kind of signal, a plot for each finger, and one of diagnostics."""
    root = ET.Element("root")
    window = ET.SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    for title, rows in curves(hand, namespace).items():
        fingers: dict[str, list[tuple[str, str]]] = {}
        for curve in rows:
            finger = curve.label.removeprefix(hand.prefix).split("_")[0]
            fingers.setdefault(f"{finger}, {title}", []).append((_series(curve, hand), curve.color))
        _add_tab(window, title, fingers)
    levels = list(zip(level_series(namespace), COLORS, strict=False))
    _add_tab(window, "diagnostics", {"levels of the controller: 0 OK, 1 warning, 2 error": levels})
    ET.SubElement(root, "use_relative_time_offset", enabled="1")
    return document(root, "Made by: hand urdf. Load it after the data: plotjuggler, Layout, Load.")


def level_series(namespace: str) -> list[str]:
    """Names that PlotJuggler gives the levels of the controller: topic, hardware_id, status, key of a value."""
    space = f"/{namespace.strip('/')}"
    return [f"{DIAGNOSTICS}/{space}/{space}/controller: {part}/level" for part in STATUSES]


def _add_tab(window: ET.Element, title: str, plots: Mapping[str, list[tuple[str, str]]]) -> None:
    """A tab with its plots one below the other. plots: series and colours by the title of the plot."""
    tab = ET.SubElement(window, "Tab", tab_name=title, containers="1")
    sizes = ";".join([f"{1.0 / len(plots):.4f}"] * len(plots))
    container = ET.SubElement(tab, "Container")
    splitter = ET.SubElement(container, "DockSplitter", orientation="-", count=str(len(plots)), sizes=sizes)
    for name, series in plots.items():
        area = ET.SubElement(splitter, "DockArea", name=name)
        plot = ET.SubElement(area, "plot", mode="TimeSeries", style="Lines", flip_x="false", flip_y="false")
        for each, color in series:
            ET.SubElement(plot, "curve", name=each, color=color)


def _series(curve: Curve, hand: Hand) -> str:
    """The name that PlotJuggler gives a signal. It knows JointState and writes the joint's name into the path."""
    if curve.topic.endswith(JOINT_STATES):
        return f"{curve.topic}/{hand.joints[curve.index]}/{curve.field}"
    return f"{curve.topic}/{curve.field}[{curve.index}]"


def rviz_text(hand: Hand, namespace: str = "hand") -> str:
    """A configuration of RViz: the hand, its frames, a grid."""
    before = frame_prefix(hand, namespace)
    robot = {
        "Class": "rviz_default_plugins/RobotModel",
        "Name": "Hand",
        "Enabled": True,
        "Description Source": "Topic",
        "Description Topic": {
            "Value": f"/{namespace.strip('/')}/{ROBOT}",
            "Depth": 1,
            "Durability Policy": "Transient Local",
            "Reliability Policy": "Reliable",
        },
        "TF Prefix": before.rstrip("/"),
    }
    frames = {"Class": "rviz_default_plugins/TF", "Name": "Frames", "Enabled": False, "Marker Scale": 0.05}
    grid = {"Class": "rviz_default_plugins/Grid", "Name": "Grid", "Enabled": True, "Cell Size": 0.05}
    view = {"Class": "rviz_default_plugins/Orbit", "Distance": 0.5, "Pitch": 0.6, "Yaw": 0.8}
    manager = {
        "Displays": [robot, frames, grid],
        "Global Options": {"Fixed Frame": before + hand.prefix + BASE, "Frame Rate": 30},
        "Tools": [{"Class": "rviz_default_plugins/MoveCamera"}],
        "Views": {"Current": view | {"Focal Point": {"X": 0.08, "Y": 0.0, "Z": 0.0}}},
    }
    return yaml_text(
        {"Panels": [{"Class": "rviz_common/Displays", "Name": "Displays"}], "Visualization Manager": manager}
    )
