"""URDF, xacro and SRDF, read by other people's parsers and compared with the description of the hand."""

from __future__ import annotations

import io
import math
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xacro
import yourdfpy

from hand_control.grasps import Grasp
from hand_model.description import Hand, load_hand
from hand_model.geometry import geometry_of, link_poses
from hand_robot.srdf import Placed, fingers, srdf_text
from hand_robot.urdf import Mount, macro_text, urdf_text
from hand_robot.xml_text import rpy_from_rotation

SEED = 20261124
ROOT = Path(__file__).resolve().parents[2]
CONFIG = ROOT / "config" / "hand.yaml"
MACRO = ROOT / "urdf" / "hand_macro.xacro"


def parsed(text: str) -> Any:
    return yourdfpy.URDF.load(io.BytesIO(text.encode()), load_meshes=False, build_scene_graph=True)


def values(root: ET.Element) -> list[tuple[str, str, Any]]:
    """Every attribute and text below an element, numbers as numbers, in the order of the document."""
    found: list[tuple[str, str, Any]] = []
    for element in root.iter():
        pairs = [*sorted(element.attrib.items()), ("", (element.text or "").strip())]
        for name, value in pairs:
            try:
                found.append((element.tag, name, [float(part) for part in value.split()]))
            except ValueError:
                found.append((element.tag, name, value))
    return found


def same(first: ET.Element, second: ET.Element) -> None:
    for (tag, name, one_value), (other_tag, other_name, other) in zip(values(first), values(second), strict=True):
        assert (tag, name) == (other_tag, other_name)
        if isinstance(one_value, list) and isinstance(other, list):
            np.testing.assert_allclose(one_value, other, atol=1e-8, err_msg=f"{tag} {name}")
        else:
            assert one_value == other, (tag, name)


def test_forward_kinematics_are_those_of_the_model(hand: Hand) -> None:
    """Broken by a wrong origin, axis or order in the URDF: every link and frame at random angles, on a mount."""
    rng = np.random.default_rng(SEED)
    print("seed", SEED)
    mount = Mount("tool0", (0.1, -0.2, 0.3), (0.0, 0.0, math.pi / 2))
    robot = parsed(urdf_text(hand, mount))
    angle = rng.uniform(hand.limits.low_rad, hand.limits.high_rad)
    robot.update_cfg(dict(zip(hand.joints, angle, strict=True)))
    base = np.eye(4)
    base[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    base[:3, 3] = mount.xyz_m
    for name, place in link_poses(hand, angle).items():
        np.testing.assert_allclose(robot.get_transform(name, "tool0"), base @ place, atol=1e-7, err_msg=name)


def test_limits_masses_and_names_are_those_of_the_description(hand: Hand) -> None:
    """Broken by a limit in degrees, an order of joints that differs, or a name without the prefix."""
    robot = parsed(urdf_text(hand))
    assert robot.validate(), robot.errors
    assert robot.base_link == f"{hand.prefix}hand_base"
    assert robot.link_map[robot.base_link].inertial is None
    assert tuple(robot.actuated_joint_names) == hand.joints
    for index, name in enumerate(hand.joints):
        limit = robot.joint_map[name].limit
        expected = (hand.limits.low_rad[index], hand.limits.high_rad[index], hand.limits.max_torque_nm[index])
        assert (limit.lower, limit.upper, limit.effort) == pytest.approx(expected)
        assert limit.velocity == pytest.approx(math.radians(400.0))
    for link in geometry_of(hand).links:
        inertial = robot.link_map[link.name].inertial
        assert inertial.mass == pytest.approx(link.mass_kg)
        np.testing.assert_allclose(np.diag(inertial.inertia), link.inertia_kg_m2, rtol=1e-8)
    assert all(name.startswith(hand.prefix) for name in [*robot.link_map, *robot.joint_map])


def test_roll_pitch_yaw_of_a_rotation_that_points_up() -> None:
    """Broken by an angle that is not defined where the pitch is 90 degrees."""
    up = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    np.testing.assert_allclose(rpy_from_rotation(up), [0.0, math.pi / 2, 0.0], atol=1e-12)


@pytest.mark.parametrize("control", ["none", "topic_based", "mujoco"])
def test_the_macro_gives_the_same_urdf_for_both_hands(hand: Hand, control: Any) -> None:
    """Broken by a number that is not mirrored in the macro, or a tag that only one of the two has."""
    mappings = {"prefix": hand.prefix, "ros2_control": control, "namespace": "arm/hand"}
    expanded = xacro.process_file(str(ROOT / "urdf" / "hand.urdf.xacro"), mappings=mappings).toxml()
    expected = ET.fromstring(urdf_text(hand, control=control, namespace="arm/hand"))
    found = ET.fromstring(expanded)
    expected.set("name", found.attrib["name"])  # a macro cannot name the robot
    same(found, expected)


def test_a_macro_of_a_left_hand_gives_the_right_one_as_its_mirror_image(tmp_path: Path) -> None:
    """Broken by a macro that mirrors by the name of the side and not relative to the side of its description."""
    (tmp_path / "hand_macro.xacro").write_text(macro_text(load_hand(CONFIG, "left_")), encoding="utf-8")
    top = tmp_path / "hand.urdf.xacro"
    top.write_text((ROOT / "urdf" / top.name).read_text(encoding="utf-8"), encoding="utf-8")
    found = ET.fromstring(xacro.process_file(str(top), mappings={"side": "right"}).toxml())
    expected = ET.fromstring(urdf_text(load_hand(CONFIG)))
    expected.set("name", found.attrib["name"])
    same(found, expected)


def test_the_macro_mounts_two_hands_on_one_arm(tmp_path: Path) -> None:
    """Broken by a name that two hands share, or a base that is not fixed to the given parent."""
    both = "".join(
        f'<xacro:fluidic_hand prefix="{side}_" parent="{side}_tool0" xyz="0 0 0.1" ros2_control="topic_based" '
        f'namespace="{side}_hand"/>'
        for side in ("left", "right")
    )
    arms = '<link name="torso"/>' + "".join(
        f'<link name="{side}_tool0"/><joint name="{side}_arm" type="fixed"><parent link="torso"/>'
        f'<child link="{side}_tool0"/></joint>'
        for side in ("left", "right")
    )
    top = tmp_path / "robot.xacro"
    top.write_text(
        f'<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="robot"><xacro:include filename="{MACRO}"/>'
        f"{arms}{both}</robot>",
        encoding="utf-8",
    )
    text = xacro.process_file(str(top)).toxml()
    robot = parsed(text)
    assert robot.validate(), robot.errors
    assert robot.base_link == "torso" and len(robot.actuated_joint_names) == 22
    np.testing.assert_allclose(robot.get_transform("left_palm", "torso")[:3, 3], [0.0, 0.0, 0.1], atol=1e-12)
    topics = [element.text for element in ET.fromstring(text).iter("param") if "topic" in element.get("name", "")]
    assert topics == [f"/{side}_hand/joint_{kind}" for side in ("left", "right") for kind in ("commands", "states")]


def test_the_srdf_fits_the_urdf(hand: Hand, grasps: dict[str, Grasp]) -> None:
    """Broken by a group, state or pair of links with a name or an angle that the URDF does not have."""
    robot = parsed(urdf_text(hand, Mount("tool0")))
    root = ET.fromstring(srdf_text([Placed(hand, grasps, mount="tool0")]))
    assert root.get("name") == robot.robot.name
    whole, *chains = root.findall("group")
    assert [joint.get("name") for joint in whole] == list(hand.joints)
    for group, (name, (tip, joints)) in zip(chains, fingers(hand).items(), strict=True):
        (chain,) = group
        assert (group.get("name"), chain.get("tip_link")) == (name, tip)
        above = {item.child: item for item in robot.joint_map.values()}
        found: list[str] = []
        link = tip
        while link != chain.get("base_link"):
            found = [above[link].name] * (above[link].type == "revolute") + found
            link = above[link].parent
        assert found == joints
    assert fingers(hand)[f"{hand.prefix}thumb"][1] == [
        hand.prefix + name for name in ("thumb_opposition", "thumb_proximal", "thumb_distal")
    ]
    states = {str(state.get("name")): state for state in root.findall("group_state")}
    assert set(states) == set(grasps)
    for name, state in states.items():
        angles = {str(joint.get("name")): float(joint.get("value", "nan")) for joint in state}
        assert angles == pytest.approx(dict(zip(hand.joints, grasps[name].shape(1.0), strict=True)))
        for joint, value in angles.items():
            limit = robot.joint_map[joint].limit
            assert limit.lower <= value <= limit.upper
    pairs = {(pair.get("link1"), pair.get("link2")) for pair in root.findall("disable_collisions")}
    assert {link for pair in pairs for link in pair} <= set(robot.link_map)
    moved = [item for item in robot.joint_map.values() if item.type == "revolute"]
    assert {(item.parent, item.child) for item in moved} <= pairs
    (effector,) = root.findall("end_effector")
    assert effector.get("parent_link") == "tool0" and effector.get("group") == whole.get("name")


def test_the_tags_of_ros2_control_name_every_joint_and_its_limits(hand: Hand) -> None:
    """Broken by a joint without an interface, a limit that differs, or topics that the nodes do not have."""
    root = ET.fromstring(urdf_text(hand, control="topic_based", namespace="/right/hand"))
    (system,) = root.findall("ros2_control")
    parameters = {item.get("name"): item.text for item in system.iterfind("hardware/param")}
    assert parameters["joint_states_topic"] == "/right/hand/joint_states"
    assert parameters["joint_commands_topic"] == "/right/hand/joint_commands"
    joints = system.findall("joint")
    assert [joint.get("name") for joint in joints] == list(hand.joints)
    for joint, low, high in zip(joints, hand.limits.low_rad, hand.limits.high_rad, strict=True):
        # One command interface, so that the message has no effort, which would limit the torque.
        (command,) = joint.findall("command_interface")
        assert command.get("name") == "position"
        assert [float(item.text or "nan") for item in command] == pytest.approx([low, high])
        assert [item.get("name") for item in joint.findall("state_interface")] == ["position", "velocity", "effort"]
