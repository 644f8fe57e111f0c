"""Causes of the whole hand: one set of numbers for all joints, and none where joints have effects of their own.

The recordings come from the kernel, so these tests show that a cause is found, not that its equations are right.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hand_diagnosis.diagnosis import Diagnosis, diagnose
from hand_model.description import Hand
from hand_model.kernel.rows import ROW
from test.diagnosis.recordings import changed, off_by_a_little, record

JOINTS = ["index_distal", "middle_proximal", "ring_proximal", "thumb_distal"]
SEED, TOLERANCE = 21, 0.05


def everywhere(hand: Hand, **values: float) -> Hand:
    """The hand with parameters of all joints changed, SI; __ stands for the dot."""
    parameters = hand.parameters.copy()
    for key, value in values.items():
        parameters[ROW[key.replace("__", ".")]] = value
    return replace(hand, parameters=parameters)


def diagnosed(true: Hand, hand: Hand, joints: list[str], seconds: float = 20.0) -> Diagnosis:
    """The diagnosis of a recording with a nominal model that is a little off."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    signals = record(true, rng, seconds)
    nominal = off_by_a_little(hand, rng)
    return diagnose([signals], nominal, tolerance=TOLERANCE, seed=0, joints=joints, sensor_curve=False)


@pytest.mark.parametrize("rubs", [False, pytest.param(True, marks=pytest.mark.long)], ids=["alone", "with friction"])
def test_a_reservoir_is_one_cause_of_all_joints(hand: Hand, rubs: bool) -> None:
    """Fails when a supply that sags is explained joint by joint, its numbers differ by joint, or an own effect is lost.

    The friction of one joint has nothing to do with the supply and must stay on its joint.
    """
    true = everywhere(hand, supply_droop__resistance_s=0.15, supply_droop__time_constant_s=4.0, supply_droop__ratio=0.7)
    expected: dict[str, str | None] = {"supply_droop": None}
    if rubs:
        true = changed(true, JOINTS[1], coulomb_friction__torque_nm=0.01)
        expected["coulomb_friction"] = JOINTS[1]
    result = diagnosed(true, hand, JOINTS[:2], 16.0)
    found = {finding.effect: finding for finding in result.findings}
    assert {effect: finding.joint for effect, finding in found.items()} == expected
    assert result.remainder == ()
    numbers = {number.key: number for number in found["supply_droop"].numbers}
    assert abs(numbers["supply_droop.resistance_s"].value - 0.15) < 3.0 * numbers["supply_droop.resistance_s"].std
    row = ROW["supply_droop.resistance_s"]
    values = set()
    for joint in result.joints:
        fit = joint.reported.final
        values.add(float(joint.search.problem.columns(fit.free, fit.z[None])[0][0, row]))
    assert len(values) == 1


@pytest.mark.long
def test_own_effects_of_joints_are_no_cause_of_the_hand(hand: Hand) -> None:
    """Fails when friction of one joint and a slow valve of another become one story about the supply or the clocks."""
    true = changed(hand, JOINTS[0], coulomb_friction__torque_nm=0.015)
    true = changed(true, JOINTS[2], valve_lag__time_constant_s=0.03)
    result = diagnosed(true, hand, JOINTS)
    assert {(finding.joint, finding.effect) for finding in result.findings} == {
        (JOINTS[0], "coulomb_friction"),
        (JOINTS[2], "valve_lag"),
    }
    assert not any(joint.causes for joint in result.joints)


@pytest.mark.long
def test_the_attitude_of_the_hand_turns_all_weights_alike(hand: Hand) -> None:
    """Fails when the weights of two joints of one hand turn by rates of their own."""
    true = everywhere(hand, gravity__turning_rad_per_s=0.03)
    for name in JOINTS[:2]:
        true = changed(true, name, gravity__sine_nm=0.025)
    result = diagnosed(true, hand, JOINTS[:2], 40.0)
    assert [finding.effect for finding in result.findings] == ["gravity", "gravity"]
    row = ROW["gravity.turning_rad_per_s"]
    rates = []
    for joint in result.joints:
        fit = joint.reported.final
        rates.append(float(joint.search.problem.columns(fit.free, fit.z[None])[0][0, row]))
    assert rates[0] == rates[1]
    assert abs(rates[0] - 0.03) < 0.003
