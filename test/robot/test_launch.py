"""What the launch files start, with classes that stand for those of launch and launch_ros."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from hand_control.declared import PARAMETERS as CONTROLLER
from hand_driver.node import PARAMETERS as DRIVER
from hand_model.description import load_hand
from hand_recording.node import PARAMETERS as RECORDER
from hand_robot.launch_nodes import ARGUMENTS, CONFIG, values_of
from hand_robot.node import PARAMETERS as FRAMES
from hand_robot.state_publisher import state_publisher
from hand_robot.urdf import Mount
from hand_ros.node import EXIT_UNCONFIGURED
from hand_sim.node import PARAMETERS as SIMULATION
from test.robot.fake_launch import declared, names_of

ROOT = Path(__file__).resolve().parents[2]
HAND = ROOT / "config" / "hand.yaml"
TEXTS = {argument.name: argument.default for argument in ARGUMENTS} | {"hand_description": str(HAND)}
TABLES = {"driver": DRIVER, "simulation": SIMULATION, "controller": CONTROLLER, "recorder": RECORDER}
TABLES["frame_publisher"] = FRAMES


def started(monkeypatch: pytest.MonkeyPatch, *, installed: bool, **given: str) -> dict[str, dict[str, Any]]:
    """What hand.launch.py gives the action of each node, by executable, with plain values of parameters."""
    actions = names_of(ROOT / "launch" / "hand.launch.py", monkeypatch, installed)["start"](TEXTS | given)
    nodes = {}
    for action in actions:
        values = action.named["parameters"][-1]
        texts = {key: value for key, value in values.items() if hasattr(value, "arguments")}
        assert all(value.named == {"value_type": str} for value in texts.values())  # else launch_ros reads YAML
        plain = values | {key: value.arguments[0] for key, value in texts.items()}
        assert not {key for key, value in plain.items() if isinstance(value, str)} - texts.keys()
        nodes[action.named["executable"]] = action.named | {"values": plain}
    return nodes


def test_the_launch_publishes_the_frames_where_it_can(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a launch needs robot_state_publisher, or does not pass mount, parameter file or level of logs on."""
    left: dict[str, Any] = {"joint_prefix": "left_", "namespace": "left_hand", "log_level": "debug"}
    left |= {"mount": "tool0", "mount_xyz": "0 0 0.05"}
    node = started(monkeypatch, installed=True, **left)["robot_state_publisher"]
    assert node["package"] == "robot_state_publisher" and node["namespace"] == "left_hand"
    assert node["ros_arguments"] == ["--log-level", "debug"]
    urdf = ET.fromstring(node["values"]["robot_description"])
    links = {link.get("name") for link in urdf.iter("link")}
    assert {"tool0", "left_palm", "left_index_tip", "left_thumb_distal_pad", "left_palm_pad"} <= links
    assert "0 0 0.05" in {origin.get("xyz") for origin in urdf.iter("origin")}
    assert node["values"]["frame_prefix"] == "" and node["values"]["use_sim_time"] is False
    own = started(monkeypatch, installed=False, **left, parameter_file="mine.yaml")["frame_publisher"]
    assert own["package"] == "fluidic_hand" and own["namespace"] == "left_hand"
    assert own["ros_arguments"] == ["--log-level", "debug"] and own["parameters"][0] == "mine.yaml"
    assert own["values"]["mount"] == "tool0" and own["values"]["mount_xyz_m"] == [0.0, 0.0, 0.05]
    (ended,) = own["on_exit"](SimpleNamespace(returncode=2, process_name="frame_publisher-1"), None)
    assert "frame_publisher-1 could not be configured" in ended.named["reason"]
    assert own["on_exit"](SimpleNamespace(returncode=0, process_name="frame_publisher-1"), None) == []
    left_out: list[dict[str, Any]] = [{"robot_state_publisher": "false"}, {"hand_description": "nowhere.yaml"}]
    for given in left_out:
        assert set(started(monkeypatch, installed=True, **given)) == {"driver", "controller"}


def test_every_node_gets_parameters_that_it_declares(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a launch sets an unknown parameter, starts the wrong nodes, or enables a real hand."""
    real = started(monkeypatch, installed=False, record="true", recording="out.mcap", transport="can")
    assert set(real) == {"driver", "controller", "recorder", "frame_publisher"}
    simulated = started(monkeypatch, installed=False, simulated="true", use_sim_time="true")
    assert set(simulated) == {"simulation", "controller", "frame_publisher"}
    for executable, node in [*real.items(), *simulated.items()]:
        assert (ROOT / "tools" / "nodes" / executable).is_file()
        known = {parameter.name for parameter in TABLES[executable]} | {"use_sim_time"}
        ends = "on_exit" in node
        assert ends == (executable != "recorder") == node["values"].get(EXIT_UNCONFIGURED.name, False)
        assert node["values"].keys() - {EXIT_UNCONFIGURED.name} <= known
    assert real["driver"]["values"]["can_bitrate"] == 1_000_000 and real["recorder"]["values"]["out"] == "out.mcap"
    assert "enabled_at_start" not in real["controller"]["values"]
    assert simulated["controller"]["values"]["enabled_at_start"] is True
    assert simulated["controller"]["values"]["use_sim_time"] and simulated["simulation"]["values"]["publish_clock"]


def test_the_launch_files_declare_every_argument(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when an argument is not declared, has no description, or the simulated hand is another launch."""
    (actions,) = names_of(ROOT / "launch" / "hand.launch.py", monkeypatch)["generate_launch_description"]().arguments
    arguments = declared(actions)
    assert set(arguments) == set(TEXTS) and all(named["description"] for named in arguments.values())
    paths = [argument.default for argument in ARGUMENTS if argument.default.startswith(CONFIG)]
    assert len(paths) == 2 and all((ROOT / path).is_file() for path in paths)
    local = next(action for action in actions if type(action).__name__ == "SetEnvironmentVariable")
    assert local.arguments == ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST") and local is not actions[-1]
    assert local.named["condition"].arguments[0].arguments == ("localhost_only",)
    assert arguments["localhost_only"]["default_value"] == "true"
    file = ROOT / "launch" / "simulated_hand.launch.py"
    ((included,),) = names_of(file, monkeypatch)["generate_launch_description"]().arguments
    assert included.named["launch_arguments"] == [("simulated", "true")]
    assert included.arguments[0].arguments == (str(ROOT / "launch" / "hand.launch.py"),)


def test_moveit_keeps_to_this_machine_by_default(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when other machines discover move_group without being asked to, or it starts before that is set."""
    file = ROOT / "moveit" / "launch" / "move_group.launch.py"
    (actions,) = names_of(file, monkeypatch)["generate_launch_description"]().arguments
    kinds = [type(action).__name__ for action in actions]
    local = actions[kinds.index("SetEnvironmentVariable")]
    assert local.arguments == ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    assert local.named["condition"].arguments[0].arguments == ("localhost_only",)
    assert declared(actions)["localhost_only"]["default_value"] == "true"
    assert kinds.index("SetEnvironmentVariable") < kinds.index("Node")


def test_moveit_plans_with_what_the_package_has(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when move_group loads a planner whose files the package lacks: without a list it loads Pilz, too."""
    file = ROOT / "moveit" / "launch" / "move_group.launch.py"
    (actions,) = names_of(file, monkeypatch)["generate_launch_description"]().arguments
    (node,) = [action.named for action in actions if type(action).__name__ == "Node"]
    assert node["parameters"][0] == {"planning_pipelines": {"pipelines": ["ompl"]}}


@pytest.mark.parametrize(
    ("name", "text", "line"),
    [
        ("mount_xyz", "0 0", "mount_xyz is '0 0'; it must be three numbers, such as 0 0 0.05"),
        ("mount_rpy", "0 0 nan", "mount_rpy is '0 0 nan'; it must be three numbers"),
        ("record", "maybe", "record is 'maybe'; it must be true or false"),
        ("serial_baud", "fast", "serial_baud is 'fast'; it must be a whole number"),
    ],
)
def test_a_wrong_argument_is_one_line(name: str, text: str, line: str) -> None:
    """Fails when a launch goes on with an argument that it does not understand."""
    with pytest.raises(ValueError, match=line):
        values_of(TEXTS | {name: text})


def test_two_hands_without_a_prefix_have_frames_of_their_own() -> None:
    """Broken by two hands in two namespaces that publish the same frames on TF."""
    frames = [(state_publisher(str(HAND), space) or {})["parameters"][0] for space in ("hand", "left", "/right/")]
    assert [values["frame_prefix"] for values in frames] == ["", "left/", "right/"]
    prefixed = state_publisher(str(HAND), "left", "left_", mount=Mount("tool0")) or {}
    assert prefixed["parameters"][0]["frame_prefix"] == ""
    assert '<link name="tool0" />' in prefixed["parameters"][0]["robot_description"]


def test_a_prefix_that_is_no_name_is_refused() -> None:
    """Broken by a prefix that DDS, TF or XML do not accept."""
    with pytest.raises(ValueError, match=r"joint_prefix is 'left hand'; it must be a name"):
        load_hand(HAND, "left hand")
    assert state_publisher(str(HAND), "hand", "left hand") is None
