"""What the launch files start for TF, with classes that stand for those of launch and launch_ros."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest

from hand_model.description import load_hand
from hand_robot.node import PARAMETERS
from hand_robot.state_publisher import state_publisher
from test.robot.fake_launch import names_of

ROOT = Path(__file__).resolve().parents[2]
CONFIG = ROOT / "config" / "hand.yaml"


def publish_frames(name: str, monkeypatch: pytest.MonkeyPatch, installed: bool, **given: str) -> list[Any]:
    """The actions of a launch file for TF."""
    context = {"hand_description": str(CONFIG), "namespace": "hand", "joint_prefix": "", "mount": ""}
    context |= {"robot_state_publisher": "true", "use_sim_time": "false"} | given
    actions: list[Any] = names_of(ROOT / "launch" / name, monkeypatch, installed)["publish_frames"](context)
    return actions


@pytest.mark.parametrize("name", ["hand.launch.py", "simulated_hand.launch.py"])
def test_the_launch_publishes_the_frames_where_it_can(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Broken by a launch that fails without robot_state_publisher, or that gives it text that YAML changes."""
    (node,) = publish_frames(name, monkeypatch, installed=True, joint_prefix="left_", namespace="left_hand")
    assert node.named["package"] == node.named["executable"] == "robot_state_publisher"
    assert node.named["namespace"] == "left_hand"
    values = {
        key: (value.arguments[0], value.named["value_type"]) for key, value in node.named["parameters"][0].items()
    }
    text, kind = values["robot_description"]
    links = {link.get("name") for link in ET.fromstring(text).iter("link")}
    assert {"left_palm", "left_index_tip", "left_thumb_distal_pad", "left_palm_pad"} <= links and kind is str
    assert values["frame_prefix"] == ("", str) and values["use_sim_time"] == (False, bool)
    (own,) = publish_frames(name, monkeypatch, installed=False, joint_prefix="left_", namespace="left_hand")
    assert (own.named["package"], own.named["executable"]) == ("fluidic_hand", "frame_publisher")
    assert own.named["namespace"] == "left_hand" and (ROOT / "tools" / "nodes" / "frame_publisher").is_file()
    declared = {parameter.name for parameter in PARAMETERS}
    given = {key: value.arguments[0] for key, value in own.named["parameters"][0].items()}
    assert given == {"hand_description": str(CONFIG), "joint_prefix": "left_", "mount": "", "use_sim_time": False}
    assert given.keys() - {"use_sim_time"} <= declared
    assert publish_frames(name, monkeypatch, installed=True, robot_state_publisher="false") == []
    assert publish_frames(name, monkeypatch, installed=True, hand_description="nowhere.yaml") == []


def test_two_hands_without_a_prefix_have_frames_of_their_own() -> None:
    """Broken by two hands in two namespaces that publish the same frames on TF."""
    frames = [(state_publisher(str(CONFIG), space) or {})["parameters"][0] for space in ("hand", "left", "/right/")]
    assert [values["frame_prefix"] for values in frames] == ["", "left/", "right/"]
    prefixed = state_publisher(str(CONFIG), "left", "left_", mount="tool0") or {}
    assert prefixed["parameters"][0]["frame_prefix"] == ""
    assert '<link name="tool0" />' in prefixed["parameters"][0]["robot_description"]


def test_a_prefix_that_is_no_name_is_refused() -> None:
    """Broken by a prefix that DDS, TF or XML do not accept."""
    with pytest.raises(ValueError, match=r"joint_prefix is 'left hand'; it must be a name"):
        load_hand(CONFIG, "left hand")
    assert state_publisher(str(CONFIG), "hand", "left hand") is None
