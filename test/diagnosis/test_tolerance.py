"""Nominal numbers that are further off than the tolerance says: no effects are invented, and real ones are found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hand_diagnosis.diagnosis import diagnose
from hand_diagnosis.problem import Task, tolerant
from hand_identification.free_parameters import NOMINAL_KEYS
from hand_model.description import Hand
from hand_model.kernel.rows import ROW
from hand_recording.signals import Signals
from test.diagnosis.recordings import changed, record

JOINTS = ["index_distal", "middle_proximal", "thumb_distal"]
SEED, TOLERANCE = 6, 0.05


def recorded(true: Hand, nominal: Hand, share: float) -> tuple[Signals, Hand]:
    """A recording of a hand, and a model whose numbers are off by a relative standard deviation."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    signals = record(true, rng, 20.0)
    parameters = nominal.parameters.copy()
    for key in NOMINAL_KEYS:
        parameters[ROW[key]] *= 1.0 + share * np.clip(rng.standard_normal(len(nominal.joints)), -2.0, 2.0)
    return signals, replace(nominal, parameters=parameters)


def tolerance_of(true: Hand, nominal: Hand, share: float, joints: list[str]) -> float:
    """The tolerance with which the joints are diagnosed."""
    signals, model = recorded(true, nominal, share)
    return tolerant(
        Task(signals=[signals], model=model, joints=joints, effects=[], tolerance=TOLERANCE, seed=0, floors={})
    )[0].tolerance


def test_wrong_numbers_of_all_joints_are_no_effects(hand: Hand) -> None:
    """Fails when numbers that are four tolerances off appear as effects, or nobody hears of them."""
    signals, model = recorded(hand, hand, 0.2)
    result = diagnose([signals], model, tolerance=TOLERANCE, seed=0, joints=JOINTS, sensor_curve=False)
    assert (result.findings, result.remainder) == ((), ())
    assert any("larger changes of the nominal numbers than the tolerance of 5 %" in line for line in result.check)


def test_right_numbers_keep_their_tolerance(hand: Hand) -> None:
    """Fails when a larger tolerance is used for a model that is as good as it says, or not the one that fits best."""
    assert tolerance_of(hand, hand, 0.03, JOINTS) == TOLERANCE
    assert tolerance_of(hand, hand, 0.2, JOINTS) == 4.0 * TOLERANCE
    assert tolerance_of(hand, hand, 0.1, JOINTS) == 2.0 * TOLERANCE


def test_the_effect_of_one_joint_changes_no_tolerance(hand: Hand) -> None:
    """Fails when the mismatch of one joint, which is an effect, passes as a wrong tolerance of the hand."""
    rubbing = changed(hand, JOINTS[0], coulomb_friction__torque_nm=0.02)
    assert tolerance_of(rubbing, hand, 0.03, JOINTS) == TOLERANCE
    assert tolerance_of(hand, hand, 0.2, JOINTS[:2]) == TOLERANCE


def test_effects_of_all_joints_are_no_wrong_numbers(hand: Hand) -> None:
    """Fails when effects that no number explains raise the tolerance because every joint has one."""
    true = changed(hand, JOINTS[0], coulomb_friction__torque_nm=0.02)
    true = changed(true, JOINTS[1], tube_lag__time_constant_s=0.05)
    true = changed(true, JOINTS[2], valve_flow_limit__choking=1.0, valve__fill_rate_pa_per_s=6e5)
    assert tolerance_of(true, hand, 0.03, JOINTS) == TOLERANCE
