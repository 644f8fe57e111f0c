"""The example with two hands: its URDF by xacro, and the arguments that its launch file gives."""

from __future__ import annotations

import io
import itertools
import types
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest
import xacro
import yaml
import yourdfpy
from typer.testing import CliRunner

from hand_recording.node import PARAMETERS
from hand_robot.launch_nodes import ARGUMENTS
from hand_tool.cli import app
from test.robot.fake_launch import declared, names_of

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "two_hands"
MACRO = str(ROOT / "urdf" / "hand_macro.xacro")


def robot(arm_prefix: str) -> Any:
    mappings = {"arm_prefix": arm_prefix, "hand_macro": MACRO}
    text = xacro.process_file(str(EXAMPLE / "two_hands.urdf.xacro"), mappings=mappings).toxml()
    return yourdfpy.URDF.load(io.BytesIO(text.encode()), load_meshes=False)


@pytest.mark.parametrize("arm_prefix", ["", "robot1_"])
def test_the_urdf_has_a_left_and_a_right_hand(arm_prefix: str) -> None:
    """Fails when both hands are of one side, share a name, or hang on the wrong arm."""
    made = robot(arm_prefix)
    assert made.validate(), made.errors
    assert made.base_link == f"{arm_prefix}torso" and len(made.actuated_joint_names) == 22
    assert all(name.startswith(arm_prefix) for name in made.actuated_joint_names)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        palm = made.get_transform(f"{arm_prefix}{side}_palm", f"{arm_prefix}torso")
        assert palm[1, 3] == pytest.approx(sign * 0.3)
        thumb = made.get_transform(f"{arm_prefix}{side}_thumb_tip", f"{arm_prefix}torso")
        # With the palms down, both thumbs point to the middle of the body.
        assert (thumb[1, 3] - palm[1, 3]) * sign < -0.05


def launched(monkeypatch: pytest.MonkeyPatch, **given: str) -> list[Any]:
    """The actions of the launch file; given: arguments other than the arm's prefix."""
    functions = names_of(EXAMPLE / "two_hands.launch.py", monkeypatch)
    stand_in: Any = types.ModuleType("xacro")
    stand_in.process_file = lambda path, mappings: xacro.process_file(path, mappings=mappings | {"hand_macro": MACRO})
    functions["both_hands"].__globals__["xacro"] = stand_in
    (description,) = functions["generate_launch_description"]().arguments
    arguments = declared(description)
    assert all(named["description"] for named in arguments.values())
    context = {name: named["default_value"] for name, named in arguments.items()}
    actions: list[Any] = functions["both_hands"](context | {"arm_prefix": "robot1_"} | given)
    return actions


def test_the_launch_gives_arguments_that_the_included_file_declares(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when an argument does not exist, is not passed on, or namespace, prefix and URDF do not fit together."""
    passed = {"use_sim_time": "true", "log_level": "debug", "hand_description": "mine.yaml"}
    actions = launched(monkeypatch, simulated="false", record="true", **passed)
    included = [action for action in actions if type(action).__name__ == "IncludeLaunchDescription"]
    assert len(included) == 2
    for side, action in zip(("left", "right"), included, strict=True):
        given = dict(action.named["launch_arguments"])
        assert set(given) <= {argument.name for argument in ARGUMENTS} and given.items() >= passed.items()
        assert given["namespace"] == f"robot1_{side}_hand" and given["joint_prefix"] == f"robot1_{side}_"
        assert given["robot_state_publisher"] == given["record"] == given["simulated"] == "false"
        assert action.arguments[0].arguments[0].arguments[0][-1] == "hand.launch.py"
    nodes = {action.named["executable"]: action.named for action in actions if "executable" in action.named}
    assert set(nodes) == {"robot_state_publisher", "joint_state_publisher", "recorder"}
    text, sources = nodes["joint_state_publisher"]["parameters"]
    assert sources["source_list"] == [f"/robot1_{side}_hand/joint_states" for side in ("left", "right")]
    assert 'name="robot1_left_index_proximal"' in text["robot_description"].arguments[0] and text["use_sim_time"]
    recorded = nodes["recorder"]["parameters"][0]
    assert recorded["namespaces"] == ["/robot1_left_hand", "/robot1_right_hand"]
    assert {parameter.name for parameter in PARAMETERS} >= recorded.keys() - {"use_sim_time"}
    assert all(node["ros_arguments"] == ["--log-level", "debug"] for node in nodes.values())
    with pytest.raises(ValueError, match="two simulated hands would both publish /clock"):
        launched(monkeypatch, use_sim_time="true")


def test_ros2_control_gets_the_controllers_of_both_hands(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Fails when a controller is started that its file does not configure, or the URDF has no tags for it."""
    for side in ("left", "right"):
        out = str(tmp_path / f"{side}.yaml")
        words = ["urdf", "--format", "controllers", "--prefix", f"robot1_{side}_", "--out", out]
        assert CliRunner().invoke(app, words).exit_code == 0
    actions = launched(monkeypatch, controllers=str(tmp_path))
    nodes = {action.named["executable"]: action.named for action in actions if "executable" in action.named}
    assert set(nodes) == {"robot_state_publisher", "ros2_control_node", "spawner"}
    *files, _ = nodes["ros2_control_node"]["parameters"]
    configured = [yaml.safe_load(Path(file).read_text(encoding="utf-8")) for file in files]
    names = [name for content in configured for name in content if name != "controller_manager"]
    assert sorted(nodes["spawner"]["arguments"]) == sorted(names) and len(set(names)) == 4
    urdf = ET.fromstring(nodes["robot_state_publisher"]["parameters"][0]["robot_description"].arguments[0])
    tags = {param.text for param in urdf.findall("ros2_control/hardware/param[@name='joint_commands_topic']")}
    assert tags == {f"/robot1_{side}_hand/joint_commands" for side in ("left", "right")}
    driven = {joint.get("name") for joint in urdf.findall("ros2_control/joint")}
    trajectory = [content for each in configured for name, content in each.items() if name.endswith("hand_controller")]
    assert driven == {joint for content in trajectory for joint in content["ros__parameters"]["joints"]}


def element_names(urdf: ET.Element, kind: str) -> set[str]:
    return {str(element.get("name")) for element in urdf.iter(kind)}


def read(name: str) -> Any:
    return yaml.safe_load((EXAMPLE / "moveit" / name).read_text(encoding="utf-8"))


def test_the_files_for_moveit_fit_the_urdf() -> None:
    """Fails when SRDF, limits, kinematics or controllers name what the URDF of both hands lacks, or lack a joint."""
    made = robot("robot1_")
    joints, links = set(made.actuated_joint_names), set(made.link_map)
    srdf = ET.parse(EXAMPLE / "moveit" / "two_hands.srdf").getroot()
    assert srdf.get("name") == made.robot.name == "two_hands"
    groups = element_names(srdf, "group")
    whole = {f"robot1_{side}_hand" for side in ("left", "right")}
    grouped = {str(joint.get("name")) for group in srdf.findall("group") for joint in group.findall("joint")}
    assert grouped == joints == {str(joint.get("name")) for joint in srdf.iterfind("group_state/joint")}
    assert {str(group.get("name")) for group in srdf.findall("group[@name='hands']/group")} == whole
    pairs = {str(pair.get(end)) for pair in srdf.findall("disable_collisions") for end in ("link1", "link2")}
    chains = {str(chain.get(end)) for chain in srdf.iter("chain") for end in ("base_link", "tip_link")}
    mounts = {str(effector.get("parent_link")) for effector in srdf.findall("end_effector")}
    assert mounts == {"robot1_left_tool0", "robot1_right_tool0"} and pairs | chains | mounts <= links
    assert {state.get("group") for state in srdf.findall("group_state")} == whole
    assert set(read("kinematics.yaml")) == groups - whole - {"hands"} and len(groups) == 13
    limits = read("joint_limits.yaml")["joint_limits"]
    assert set(limits) == joints
    for name, limit in limits.items():
        assert limit["max_velocity"] <= made.joint_map[name].limit.velocity + 1e-6


def test_moveit_drives_the_actions_of_the_launched_hands(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a controller of MoveIt has another namespace than its hand, or a joint of the other hand."""
    simple = read("moveit_controllers.yaml")["moveit_simple_controller_manager"]
    hands = [action for action in launched(monkeypatch) if type(action).__name__ == "IncludeLaunchDescription"]
    given = [dict(action.named["launch_arguments"]) for action in hands]
    assert simple["controller_names"] == [each["namespace"] for each in given]
    driven = [simple[each["namespace"]]["joints"] for each in given]
    for each, joints in zip(given, driven, strict=True):
        assert joints and all(joint.startswith(each["joint_prefix"]) for joint in joints)
        assert simple[each["namespace"]]["action_ns"] == "follow_joint_trajectory"
    assert sorted(itertools.chain(*driven)) == sorted(robot("robot1_").actuated_joint_names)


def test_the_documented_command_writes_the_files_for_moveit(tmp_path: Path) -> None:
    """Fails when `hand urdf` with several hands writes other names or files than the example has."""
    out = tmp_path / "moveit"
    words = ["--prefix", "robot1_", "--hands", "left,right", "--mount", "tool0", "--robot", "two_hands"]
    assert CliRunner().invoke(app, ["urdf", "--format", "moveit", *words, "--out", str(out)]).exit_code == 0
    files = {path.name: path.read_text(encoding="utf-8") for path in (EXAMPLE / "moveit").iterdir()}
    assert files == {path.name: path.read_text(encoding="utf-8") for path in out.iterdir()}


def test_move_group_gets_the_files_of_its_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a file that move_group reads does not exist, or a folder of another prefix is not refused."""
    functions = names_of(EXAMPLE / "move_group.launch.py", monkeypatch)
    (actions,) = functions["generate_launch_description"]().arguments
    arguments = {name: named["default_value"] for name, named in declared(actions).items()}
    local = [type(action).__name__ for action in actions].index("SetEnvironmentVariable")
    assert actions[local].arguments == ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST") and local < len(actions) - 1
    (node,) = functions["move_group"](arguments)
    parameters, sim_time = node.named["parameters"]
    assert sim_time == {"use_sim_time": False} and parameters.pop("planning_pipelines") == {"pipelines": ["ompl"]}
    assert parameters["robot_description"]["mappings"] == {"arm_prefix": "robot1_"}
    files = {Path(named["file_path"]) for named in parameters.values()}
    assert files == {EXAMPLE / "two_hands.urdf.xacro", *(EXAMPLE / "moveit").iterdir()}
    with pytest.raises(ValueError, match=r"arm_prefix is '', but .* has the joint robot1_left_\w+; write its files"):
        functions["move_group"](arguments | {"arm_prefix": ""})
