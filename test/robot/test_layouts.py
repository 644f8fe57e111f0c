"""Layouts and the configuration of RViz: every name in them is one of the hand."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET

import yaml

from hand_model.description import Hand
from hand_robot.layouts import curves, foxglove_text, plotjuggler_text, rviz_text


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
