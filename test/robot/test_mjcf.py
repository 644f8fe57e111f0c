"""The MJCF in MuJoCo: kinematics, inertias and Eq. 6 of the actuators, compared with the model of the hand."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from hand_model.description import Hand
from hand_model.geometry import link_poses, mass_matrix
from hand_robot.mjcf import armatures, mjcf_text

SEED = 20261125


@pytest.fixture(scope="module")
def model(hand: Hand) -> Any:
    return mujoco.MjModel.from_xml_string(mjcf_text(hand))


def test_bodies_and_sites_are_where_the_model_has_them(hand: Hand, model: Any) -> None:
    """Broken by a wrong pose, axis, sign or order: every link and frame at random angles."""
    rng = np.random.default_rng(SEED)
    print("seed", SEED)
    data = mujoco.MjData(model)
    data.qpos = rng.uniform(hand.limits.low_rad, hand.limits.high_rad)
    mujoco.mj_kinematics(model, data)
    for name, place in link_poses(hand, data.qpos).items():
        found = data.body(name) if name in {model.body(i).name for i in range(model.nbody)} else data.site(name)
        np.testing.assert_allclose(found.xpos, place[:3, 3], atol=1e-6, err_msg=name)
        np.testing.assert_allclose(found.xmat.reshape(3, 3), place[:3, :3], atol=1e-6, err_msg=name)


def test_the_inertia_is_that_of_the_links_and_the_actuators(hand: Hand, model: Any) -> None:
    """Broken by a mass, centre or moment that MuJoCo reads differently, or by a missing armature."""
    rng = np.random.default_rng(SEED)
    print("seed", SEED)
    data = mujoco.MjData(model)
    data.qpos = rng.uniform(hand.limits.low_rad, hand.limits.high_rad)
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    expected = mass_matrix(hand, data.qpos) + np.diag(armatures(hand))
    np.testing.assert_allclose(full, expected, rtol=1e-5, atol=1e-10)


def test_pressure_holds_the_angle_of_equation_6(hand: Hand, model: Any) -> None:
    """Broken by a wrong gain or bias of an actuator, by weight, or by contacts of neighbouring links.

    At rest a_0 + a_1 phi + a_2 p + a_3 p phi = 0. The pressure rises with the time constant of the valve.
    """
    data = mujoco.MjData(model)
    pressure = np.linspace(0.2e5, 0.35e5, model.nu)
    data.ctrl = pressure
    constant = hand.row("valve.time_constant_s")[0]
    while data.time < constant:
        mujoco.mj_step(model, data)
    np.testing.assert_allclose(data.act, pressure * (1.0 - np.exp(-data.time / constant)), rtol=0.01)
    while data.time < 8.0:
        mujoco.mj_step(model, data)
    a0, a1, a2, a3 = (
        hand.row(f"statics.{key}") for key in ("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad")
    )
    expected = -(a0 + a2 * pressure) / (a1 + a3 * pressure)
    assert np.all(expected > hand.limits.low_rad) and np.all(expected < hand.limits.high_rad)
    np.testing.assert_allclose(data.qpos, expected, atol=np.radians(0.1))


def test_servos_reach_the_commanded_angles_within_the_torque_limit(hand: Hand) -> None:
    """Fails when a position command of ros2_control moves no joint, a joint beyond it, or with more than its torque.

    mujoco_ros2_control takes an actuator for one of positions where its gain is the opposite of its stiffness.
    """
    model: Any = mujoco.MjModel.from_xml_string(mjcf_text(hand, servos=True))
    np.testing.assert_array_equal(model.actuator_gainprm[:, 0], -model.actuator_biasprm[:, 1])
    data = mujoco.MjData(model)
    data.ctrl = np.linspace(0.3, 1.0, model.nu)
    highest, torque = np.zeros(model.nq), np.zeros(model.nu)
    while data.time < 0.5:
        mujoco.mj_step(model, data)
        highest, torque = np.maximum(highest, data.qpos), np.maximum(torque, np.abs(data.actuator_force))
    np.testing.assert_allclose(data.qpos, data.ctrl, atol=np.radians(0.1))
    assert np.all(highest < data.ctrl + np.radians(1.0))
    np.testing.assert_allclose(torque, hand.limits.max_torque_nm)


def test_closed_grasps_of_nothing_do_not_pass_through_each_other(hand: Hand, model: Any, grasps: Any) -> None:
    """Broken by a thumb that passes through a finger in a closed pattern, or by contacts of a resting hand."""
    data = mujoco.MjData(model)
    for name, grasp in grasps.items():
        data.qpos = grasp.shape(1.0)
        mujoco.mj_forward(model, data)
        assert data.ncon == 0, name
    data.qpos[:3] = np.radians([90.0, 100.0, 100.0])  # a thumb in the fingers of a fist
    mujoco.mj_forward(model, data)
    data.qpos[3:] = np.radians(100.0)
    mujoco.mj_forward(model, data)
    assert data.ncon > 0
