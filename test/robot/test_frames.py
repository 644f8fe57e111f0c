"""The frames that are published on TF, compared with the forward kinematics of the model."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hand_model.description import Hand
from hand_model.geometry import PALM, link_poses
from hand_robot.frames import transforms_of
from hand_robot.urdf import BASE, Mount, urdf_text

SEED = 20261125


def test_the_frames_are_where_the_model_puts_them(hand: Hand) -> None:
    """Broken by a wrong order, axis or sign of a rotation: every frame at random angles, on a turned mount."""
    rng = np.random.default_rng(SEED)
    print("seed", SEED)
    mount = Mount("tool0", (0.1, -0.2, 0.3), (0.3, -0.4, 1.2))
    transforms = transforms_of(urdf_text(hand, mount), "left/")
    assert {transform.joint for transform in transforms} - {""} == set(hand.joints)
    angle = rng.uniform(hand.limits.low_rad, hand.limits.high_rad)
    poses = {"left/tool0": np.eye(4)}
    for transform in transforms:
        place = np.eye(4)
        turn = angle[hand.joints.index(transform.joint)] if transform.joint else 0.0
        place[:3, :3] = Rotation.from_quat(transform.turned(float(turn))).as_matrix()
        place[:3, 3] = transform.xyz_m
        poses[transform.child] = poses[transform.parent] @ place
    base = poses[f"left/{hand.prefix}{BASE}"]
    assert base[:3, 3] == pytest.approx(mount.xyz_m)
    np.testing.assert_allclose(base[:3, :3], Rotation.from_euler("xyz", mount.rpy_rad).as_matrix(), atol=1e-9)
    palm = np.linalg.inv(poses[f"left/{hand.prefix}{PALM}"])
    expected = link_poses(hand, angle)
    assert len(expected) == len(poses) - 2
    for name, pose in expected.items():
        np.testing.assert_allclose(palm @ poses[f"left/{name}"], pose, atol=1e-8, err_msg=name)


def test_a_joint_that_tf_cannot_follow_is_refused() -> None:
    """Broken by a sliding joint that is published as if it turned."""
    text = '<robot><joint name="slide" type="prismatic"><parent link="a"/><child link="b"/></joint></robot>'
    with pytest.raises(ValueError, match="joint slide is prismatic; TF is published for fixed and revolute joints"):
        transforms_of(text)
