"""Files that are made from hand.yaml: the layouts, the macro, controllers and the MoveIt configuration."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path

import ament_index_python.packages
import pytest
import xacro
import yaml
from typer.testing import CliRunner

from hand_model.description import load_hand
from hand_robot.kept_files import kept_files
from hand_robot.ros2_control import controllers
from hand_tool.cli import app

ROOT = Path(__file__).resolve().parents[2]
MOVEIT = ROOT / "moveit"
HAND = load_hand(ROOT / "config" / "hand.yaml")


@pytest.mark.parametrize("name", kept_files(ROOT))
def test_every_kept_file_is_current(name: str) -> None:
    """Fails when hand.yaml or a writer changes without: python -m hand_robot.kept_files --write."""
    assert (ROOT / name).read_text(encoding="utf-8") == kept_files(ROOT)[name]


def test_the_moveit_package_fits_the_urdf(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when limits, groups or controllers of MoveIt name a joint that the URDF of the package does not have.

    The URDF is made by xacro, from the package's own file.
    """
    monkeypatch.setattr(ament_index_python.packages, "get_package_share_directory", lambda _: str(ROOT))
    document = xacro.process_file(str(MOVEIT / "config" / "fluidic_hand.urdf.xacro"))
    urdf = ET.fromstring(document.toxml())
    joints = {str(joint.get("name")): joint for joint in urdf.iter("joint") if joint.get("type") == "revolute"}
    assert tuple(joints) == HAND.joints

    limits = yaml.safe_load((MOVEIT / "config" / "joint_limits.yaml").read_text(encoding="utf-8"))["joint_limits"]
    assert set(limits) == set(joints)
    for name, joint in joints.items():
        (limit,) = joint.findall("limit")
        assert limits[name]["max_velocity"] <= float(limit.get("velocity", "nan")) + 1e-6
        assert limits[name]["max_acceleration"] == pytest.approx(math.radians(15000.0))

    srdf = ET.parse(MOVEIT / "config" / "fluidic_hand.srdf").getroot()
    assert srdf.get("name") == urdf.get("name") == "fluidic_hand"
    groups = {str(group.get("name")) for group in srdf.findall("group")}
    solvers = yaml.safe_load((MOVEIT / "config" / "kinematics.yaml").read_text(encoding="utf-8"))
    assert set(solvers) == groups - {"hand"}
    links = {link.get("name") for link in urdf.iter("link")}
    assert {chain.get(end) for chain in srdf.iter("chain") for end in ("base_link", "tip_link")} <= links

    manager = yaml.safe_load((MOVEIT / "config" / "moveit_controllers.yaml").read_text(encoding="utf-8"))
    simple = manager["moveit_simple_controller_manager"]
    (name,) = simple["controller_names"]
    assert f"/{name}/{simple[name]['action_ns']}" == "/hand/follow_joint_trajectory"
    assert simple[name]["joints"] == list(HAND.joints)


def test_the_moveit_package_installs_what_it_has_and_names_what_it_uses() -> None:
    """Fails when the package lacks a file, or its launch file uses a package that package.xml does not name."""
    manifest = ET.parse(MOVEIT / "package.xml").getroot()
    depends = {item.text for item in manifest.iter("exec_depend")}
    assert manifest.findtext("name") == "fluidic_hand_moveit_config"
    assert manifest.findtext("version") == ET.parse(ROOT / "package.xml").getroot().findtext("version")
    cmake = (MOVEIT / "CMakeLists.txt").read_text(encoding="utf-8")
    assert "DIRECTORY config launch" in cmake and "project(fluidic_hand_moveit_config)" in cmake
    text = (MOVEIT / "launch" / "move_group.launch.py").read_text(encoding="utf-8")
    for package in ("moveit_configs_utils", "moveit_ros_move_group"):
        assert package in text and package in depends
    assert {"fluidic_hand", "xacro", "moveit_kinematics", "moveit_simple_controller_manager"} <= depends


def test_the_controllers_of_two_hands_differ() -> None:
    """Fails when two hands claim one controller, or a controller names a joint that the hand does not have."""
    left, right = (load_hand(ROOT / "config" / "hand.yaml", prefix) for prefix in ("left_", "right_"))
    made = [controllers(hand) for hand in (left, right)]
    assert set(made[0]) & set(made[1]) == {"controller_manager"}
    for hand, content in zip((left, right), made, strict=True):
        manager = content["controller_manager"]["ros__parameters"]
        names = [name for name, value in manager.items() if isinstance(value, dict)]
        assert set(names) == set(content) - {"controller_manager"}
        for name in names:
            assert content[name]["ros__parameters"]["joints"] == list(hand.joints)
        limits = content[f"{hand.prefix}hand_controller"]["ros__parameters"]["constraints"]
        assert set(hand.joints) <= set(limits)


def test_the_files_for_moveit_are_those_of_the_prefix(tmp_path: Path) -> None:
    """Fails when `hand urdf --format moveit` names a joint without its prefix, another namespace, or no mount."""
    out = tmp_path / "moveit"
    words = ["--prefix", "left_", "--namespace", "/left_hand/", "--mount", "tool0", "--out", str(out)]
    assert CliRunner().invoke(app, ["urdf", "--format", "moveit", *words]).exit_code == 0
    assert {path.name for path in out.iterdir()} == {
        Path(name).name for name in kept_files(ROOT) if name.startswith("moveit/")
    }
    read = {path.stem: yaml.safe_load(path.read_text(encoding="utf-8")) for path in out.glob("*.yaml")}
    joints = load_hand(ROOT / "config" / "hand.yaml", "left_").joints
    assert tuple(read["joint_limits"]["joint_limits"]) == joints
    simple = read["moveit_controllers"]["moveit_simple_controller_manager"]
    assert simple["controller_names"] == ["left_hand"] and tuple(simple["left_hand"]["joints"]) == joints
    srdf = ET.parse(out / "fluidic_hand.srdf").getroot()
    assert {effector.get("parent_link") for effector in srdf.findall("end_effector")} == {"tool0"}
    assert set(read["kinematics"]) == {str(group.get("name")) for group in srdf.findall("group")} - {"left_hand"}
