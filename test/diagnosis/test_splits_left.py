"""What is left on training and on test data, where the validation data show nothing of it; and the noise there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hand_diagnosis.diagnosis import Diagnosis, diagnose
from hand_diagnosis.problem import noise_law, spans_of_test
from hand_identification.joint_data import joint_problem
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.effects import EFFECTS
from hand_model.kernel.plant_rows import DEGREE
from hand_recording.signals import Signals
from test.diagnosis.recordings import off_by_a_little, record

JOINT = "index_proximal"
SEED = 61
SECONDS = 40.0
RIVALS = ("hysteresis", "coulomb_friction", "constant_load", "valve_lag", "angle_offset")
SIZE_RAD = 1.5 * DEGREE


@pytest.fixture(scope="module")
def plain(hand: Hand) -> Signals:
    """A recording of the hand as its model says it is."""
    print(f"seed {SEED}")
    return record(hand, np.random.default_rng(SEED), SECONDS)


def diagnosed(signals: Signals, hand: Hand, added_rad: Array) -> Diagnosis:
    """The diagnosis of one joint whose angle has (T,) [rad] in addition that no model knows."""
    angle = signals.angle_rad.copy()
    angle[:, signals.joints.index(JOINT)] += added_rad
    nominal = off_by_a_little(hand, np.random.default_rng(SEED + 1))
    changed = replace(signals, angle_rad=angle)
    others = [
        effect.name for effect in EFFECTS.values() if effect.name not in RIVALS
    ]  # the whole catalogue takes minutes
    return diagnose([changed], nominal, tolerance=0.05, seed=0, joints=[JOINT], sensor_curve=False, without=others)


def bump(signals: Signals, hand: Hand) -> Array:
    """A half sine (T,) [rad] inside a block that is fitted, in the middle of the recording."""
    problem = joint_problem([signals], hand, JOINT)
    block = problem.segments[0].block
    trained = [k for k in np.unique(block) if not problem.validation[k] and k > problem.blocks // 3]
    inside = np.flatnonzero(block == trained[0])
    added = np.zeros(signals.samples)
    added[inside] = 4.0 * SIZE_RAD * np.sin(np.pi * np.arange(len(inside)) / len(inside))
    return added


def wave(signals: Signals, hand: Hand) -> Array:
    """A slow wave (T,) [rad] that begins with the test data."""
    cut = spans_of_test(joint_problem([signals], hand, JOINT))[0][0]
    after_s = np.maximum(np.arange(signals.samples) - cut, 0) * signals.period_s
    return np.asarray(SIZE_RAD * np.sin(2.0 * np.pi * after_s / 5.0))


def test_an_event_in_a_fitted_block_remains(plain: Signals, hand: Hand) -> None:
    """Fails when only validation data count: the event lies in none of their blocks."""
    found = diagnosed(plain, hand, bump(plain, hand))
    assert found.verdict in ("unknown_physics", "partly_explained"), found.findings
    assert [left.split for left in found.remainder if left.joint == JOINT] == ["train"]


def test_a_change_after_the_fitted_data_remains(plain: Signals, hand: Hand) -> None:
    """Fails when test data have no say in what remains, or the report places the change elsewhere than in them."""
    found = diagnosed(plain, hand, wave(plain, hand))
    assert found.verdict in ("unknown_physics", "partly_explained"), found.findings
    left = next(left for left in found.remainder if left.joint == JOINT)
    assert left.split == "test" and "noise of the test data" in left.statement
    (begin, end), = left.when  # fmt: skip
    assert begin > 0.75 * SECONDS and end > begin + 5.0


def test_a_joint_without_either_agrees(plain: Signals, hand: Hand) -> None:
    """Fails when noise of training or test data, or what the fit leaves undetermined, passes as physics."""
    found = diagnosed(plain, hand, np.zeros(plain.samples))
    assert found.verdict == "agrees", found.remainder
    assert {each.split for result in found.joints[0].results for each in result.elsewhere} == {"train", "test"}


def test_a_signal_that_moves_once_has_the_noise_of_its_rest() -> None:
    """Fails when slopes of rounding, at rest, are taken for a noise that grows without bound in the only step."""
    samples = 3000
    motion = 4e4 * (1.0 - np.exp(-np.arange(samples) / 3.0))
    for seed in range(SEED, SEED + 10):
        noise = 600.0 * np.random.default_rng(seed).standard_normal(samples)
        still, by_slope = noise_law(noise, motion, np.ones(samples, dtype=bool))
        measured = np.sqrt(still + by_slope * np.mean(np.gradient(motion) ** 2))
        assert measured == pytest.approx(600.0, rel=0.1), seed


@pytest.mark.parametrize("jitter", [0.0, 1.0, 4.0])
def test_noise_that_grows_with_speed_is_measured(jitter: float) -> None:
    """Fails when the noise of samples taken at wrong times is off by 10 %, or smooth structure counts as noise."""
    rng = np.random.default_rng(SEED)
    time = np.arange(4000) * 0.01
    motion = np.sin(0.9 * time) * (1.0 + np.sin(0.11 * time))
    speed = np.gradient(motion)
    noise = 1e-3 * rng.standard_normal(len(time)) + jitter * 0.3 * speed * rng.standard_normal(len(time))
    structure = 0.02 * np.sin(2.0 * time)
    use = rng.random(len(time) // 100).repeat(100) < 0.6  # blocks
    still, by_slope = noise_law(noise + structure, motion, np.ones(len(time), dtype=bool))
    for part in (use, ~use):
        expected = float(np.sqrt(np.mean(noise[part] ** 2)))
        measured = np.sqrt(still + by_slope * np.mean(np.gradient(motion)[part] ** 2))
        assert measured == pytest.approx(expected, rel=0.1)
