"""Layouts and the configuration of RViz: every name in them is one of the hand."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import yaml

from hand_model.description import Hand
from hand_robot.layouts import COLORS, curves, foxglove_text, plotjuggler_text, rviz_text, shade
from test.pages.colour_vision import DEFICIENCIES, LEAST, seen


def test_foxglove_shows_every_panel_and_every_joint_once(hand: Hand) -> None:
    """Broken by a panel that the layout does not place, or a plot without a joint."""
    data = json.loads(foxglove_text(hand, "left_hand"))

    def placed(node: object) -> list[str]:
        return [node] if isinstance(node, str) else placed(node["first"]) + placed(node["second"])  # type: ignore[index]

    assert sorted(placed(data["layout"])) == sorted(data["configById"])
    robot = data["configById"]["3D!hand"]["layers"]["hand"]
    assert robot["topic"] == "/left_hand/robot_description"
    assert robot["jointStatesTopic"] == "/left_hand/joint_states"
    count = {title: len(rows) for title, rows in curves(hand, "left_hand").items()}
    assert list(count.values()) == [22, 22, 11, 11]
    angles = data["configById"]["Plot!angles"]["paths"]
    assert [path["label"] for path in angles][:11] == list(hand.joints)
    assert all(path["value"].startswith("/left_hand/") for path in angles)


def test_plotjuggler_and_rviz_name_the_hand(hand: Hand) -> None:
    """Broken by a curve that is listed under another finger, or a fixed frame that the URDF does not have."""
    root = ET.fromstring(plotjuggler_text(hand, "left_hand"))
    areas = root.findall(".//DockArea")
    assert len(areas) == 5 * 2 + 6 + 5 + 1
    index = next(area for area in areas if str(area.get("name")).startswith("index, angles"))
    names = {str(curve.get("name")) for curve in index.iter("curve")}
    assert f"/left_hand/joint_states/{hand.prefix}index_distal/position" in names
    assert f"/left_hand/controller_state/reference[{hand.joints.index(hand.prefix + 'index_distal')}]" in names
    manager = yaml.safe_load(rviz_text(hand, "left_hand"))["Visualization Manager"]
    before = "" if hand.prefix else "left_hand/"
    assert manager["Global Options"]["Fixed Frame"] == f"{before}{hand.prefix}hand_base"
    assert manager["Displays"][0]["TF Prefix"] == before.rstrip("/")


@pytest.mark.parametrize("deficiency", DEFICIENCIES)
def test_a_set_point_does_not_look_like_its_measurement(deficiency: str) -> None:
    """Broken by a shade that a reader, with or without a deficiency, takes for the colour itself."""
    matrix = DEFICIENCIES[deficiency]
    distances = {color: float(np.linalg.norm(seen(color, matrix) - seen(shade(color), matrix))) for color in COLORS}
    closest = min(distances, key=lambda color: distances[color])
    assert distances[closest] >= LEAST, (closest, shade(closest), distances[closest])


def test_no_two_curves_of_a_layout_have_the_same_colour(hand: Hand) -> None:
    """Broken by a set-point in the colour of a measurement, in either layout."""
    data = json.loads(foxglove_text(hand, "left_hand"))["configById"]
    root = ET.fromstring(plotjuggler_text(hand, "left_hand"))
    for title in ("angles", "pressures"):
        colors = [path["color"] for path in data[f"Plot!{title}"]["paths"]]
        assert len(set(colors)) == len(colors) == 2 * len(hand.joints), title
    for area in root.findall(".//DockArea"):
        colors = [str(curve.get("color")) for curve in area.iter("curve")]
        assert len(set(colors)) == len(colors), area.get("name")
