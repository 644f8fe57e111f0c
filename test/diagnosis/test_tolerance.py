"""Nominal numbers that are further off than the tolerance says: no effects are invented, and real ones are found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from hand_diagnosis.diagnosis import diagnose
from hand_diagnosis.diagnosis.hand import _reads_through_curve as reads_through_curve
from hand_diagnosis.problem import Task, effects_without
from hand_diagnosis.search import tolerant
from hand_diagnosis.search.tolerance import _best_models as best_models
from hand_diagnosis.search.tolerance import _more_tolerant as more_tolerant
from hand_identification.free_parameters import NOMINAL_KEYS
from hand_model.description import Hand
from hand_model.effects.effect import Effect
from hand_model.kernel.rows import ROW
from hand_recording.signals import Signals
from test.diagnosis.recordings import changed, record

JOINTS = ["index_distal", "middle_proximal", "thumb_distal"]
SEED, TOLERANCE = 6, 0.05
EVERYWHERE = [{"valve_lag__time_constant_s": 0.03}, {"coulomb_friction__torque_nm": 0.02}]


def recorded(true: Hand, nominal: Hand, share: float, seed: int = SEED) -> tuple[Signals, Hand]:
    """A recording of a hand, and a model whose numbers are off by a relative standard deviation."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    signals = record(true, rng, 20.0)
    parameters = nominal.parameters.copy()
    for key in NOMINAL_KEYS:
        parameters[ROW[key]] *= 1.0 + share * np.clip(rng.standard_normal(len(nominal.joints)), -2.0, 2.0)
    return signals, replace(nominal, parameters=parameters)


def task_of(signals: Signals, model: Hand, joints: list[str], effects: Sequence[Effect]) -> Task:
    """The diagnosis of a recording."""
    return Task(
        signals=[signals], model=model, joints=joints, effects=list(effects), tolerance=TOLERANCE, seed=0, floors={}
    )


def tolerance_of(
    true: Hand, nominal: Hand, share: float, joints: list[str], effects: Sequence[Effect] = (), seed: int = SEED
) -> float:
    """The tolerance with which the joints are diagnosed."""
    signals, model = recorded(true, nominal, share, seed)
    return tolerant(task_of(signals, model, joints, effects))[0].tolerance


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


@pytest.mark.parametrize(
    "joints",
    [pytest.param(JOINTS[:1], id="one joint"), pytest.param(JOINTS[:2], id="two joints", marks=pytest.mark.long)],
)
def test_wrong_numbers_of_few_joints_are_no_effects(hand: Hand, joints: list[str]) -> None:
    """Fails when one or two joints, whose numbers are off by more than the tolerance, get effects for them."""
    signals, model = recorded(hand, hand, 0.2)
    result = diagnose([signals], model, tolerance=TOLERANCE, seed=0, joints=joints, sensor_curve=False)
    assert (result.findings, result.remainder) == ((), ())
    assert any("larger changes of the nominal numbers than the tolerance of 5 %" in line for line in result.check)


@pytest.mark.parametrize("seed", [12, 15])
def test_one_joint_has_a_larger_tolerance_at_odds_of_20_to_1(hand: Hand, seed: int) -> None:
    """Fails when wrong numbers, of which a recording shows little, keep a tolerance with which effects explain them."""
    assert tolerance_of(hand, hand, 0.1, JOINTS[:1], effects_without((), hand), seed) == 2.0 * TOLERANCE


def test_an_effect_of_few_joints_changes_no_tolerance(hand: Hand) -> None:
    """Fails when one or two joints have a larger tolerance for right numbers, or for an effect that one of them has."""
    effects = effects_without((), hand)
    assert tolerance_of(hand, hand, 0.03, JOINTS[:2], effects) == TOLERANCE
    for change in ({"coulomb_friction__torque_nm": 0.02}, {"valve_lag__time_constant_s": 0.03}):
        true = changed(hand, JOINTS[0], **change)
        for seed in (SEED, 8, 10):
            assert tolerance_of(true, hand, 0.03, JOINTS[:1], effects, seed) == TOLERANCE, (change, seed)


def test_a_larger_tolerance_gains_no_more_than_is_said(hand: Hand) -> None:
    """Fails when the evidence with a larger tolerance rises by more than the gain up to which none is tried."""
    signals, model = recorded(hand, hand, 0.2)
    effects = effects_without((), hand)
    task = task_of(signals, model, JOINTS[:1], effects)
    (given,) = best_models(task, task.nominal_fits())
    for tried in more_tolerant(task):
        (best,) = best_models(tried, tried.nominal_fits())
        assert 10.0 < best.evidence - given.evidence < given.to_gain
        assert best.to_gain < given.to_gain
        assert best.explained.all()


def test_effects_of_all_joints_are_no_wrong_numbers(hand: Hand) -> None:
    """Fails when effects that no number explains raise the tolerance because every joint has one."""
    true = changed(hand, JOINTS[0], coulomb_friction__torque_nm=0.02)
    true = changed(true, JOINTS[1], tube_lag__time_constant_s=0.05)
    true = changed(true, JOINTS[2], valve_flow_limit__choking=1.0, valve__fill_rate_pa_per_s=6e5)
    assert tolerance_of(true, hand, 0.03, JOINTS) == TOLERANCE


@pytest.mark.parametrize("change", EVERYWHERE, ids=["slow valves", "dry friction"])
def test_wrong_numbers_are_found_next_to_an_effect_of_every_joint(hand: Hand, change: dict[str, float]) -> None:
    """Fails when no plain model fits, because every joint has an effect, and wrong numbers become effects for that.

    Of the slow valves, the angles over the measured pressures show the numbers; of friction, models with one effect.
    """
    true = hand
    for joint in JOINTS:
        true = changed(true, joint, **change)
    assert tolerance_of(true, hand, 0.2, JOINTS, effects_without((), hand)) > TOLERANCE


def test_one_joint_may_be_further_off_than_the_others(hand: Hand) -> None:
    """Fails when wrong numbers of one joint become its effects because those of the others are right."""
    signals, far = recorded(hand, hand, 0.2)
    _, near = recorded(hand, hand, 0.03)
    parameters = near.parameters.copy()
    column = hand.joints.index(JOINTS[0])
    parameters[:, column] = far.parameters[:, column]
    model = replace(hand, parameters=parameters)
    found, lines = tolerant(task_of(signals, model, JOINTS, effects_without((), hand)))
    assert found.tolerance == TOLERANCE
    assert list(found.looser) == JOINTS[:1]
    assert any(line.startswith(f"{JOINTS[0]} asks for larger changes") for line in lines)


@pytest.mark.parametrize("joints", [JOINTS[:1], JOINTS[:2]], ids=["one joint", "two joints"])
def test_wrong_numbers_do_not_decide_what_the_angles_are(hand: Hand, joints: list[str]) -> None:
    """Fails when readings of Hall sensors are taken for angles, or angles for readings, because numbers are off."""
    angles, model = recorded(hand, hand, 0.2, seed=8)
    read = hand.sensors.angle_line.angle_rad(hand.sensors.hall.ratio(angles.angle_rad))
    readings = replace(angles, angle_rad=read)
    effects = effects_without((), hand)
    assert reads_through_curve([readings], model, joints, TOLERANCE, effects)
    assert not reads_through_curve([angles], model, joints, TOLERANCE, effects)
