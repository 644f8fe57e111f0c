"""Certificates: attacks on remainders that the test knows, from plants of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from jsonschema import validate

from hand_diagnosis.diagnosis import Diagnosis, diagnose
from hand_diagnosis.judgement import GAUSSIAN_PROCESS, LAGGED_INPUTS, Certificate, certify, stage_results
from hand_diagnosis.problem import evaluate_test, fit_part
from hand_diagnosis.report import document, schema
from hand_diagnosis.settings import SETTINGS
from hand_identification.free_parameters import nominal_free_parameters
from hand_identification.joint_data import joint_problem
from hand_identification.map_fit import map_fit
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.effects import CATALOGUE
from hand_recording.signals import Signals
from test.diagnosis.recordings import changed, off_by_a_little, record

JOINT, SEED, SECONDS = "index_distal", 61, 32.0
DEGREE = np.pi / 180.0


@pytest.fixture(scope="module")
def plain(hand: Hand) -> Signals:
    """A recording of the hand as its model says it is."""
    print(f"seed {SEED}")
    return record(hand, np.random.default_rng(SEED), SECONDS)


def attacked(signals: Signals, hand: Hand, added: Callable[[Signals, int], Array]) -> dict[str, Certificate]:
    """The certificates of a joint by signal, where `added` (T,) [rad] stands in the angle and in no model."""
    column = signals.joints.index(JOINT)
    angle = signals.angle_rad.copy()
    angle[:, column] += added(signals, column)
    whole = joint_problem([replace(signals, angle_rad=angle)], hand, JOINT)
    problem, free = fit_part(whole), nominal_free_parameters(whole.nominal, 0.01, True)
    fit = map_fit(problem, free, np.zeros(len(free)), 4)
    results = stage_results(problem, fit, fit, 1)
    found = certify(problem, whole, fit, results, free_axis=False)
    test = evaluate_test(whole, [fit], free_axis=False)
    assert test is not None
    for each in found:
        assert each.before == pytest.approx(test.rmse(0)[each.stage], rel=1e-6), "errors are those of the test data"
    return {results[k].name: each for k, each in enumerate(found)}


def test_a_correct_model_keeps_its_certificates(plain: Signals, hand: Hand) -> None:
    """Fails when an attack learns noise, or what the repeatability forbids to claim."""
    found = attacked(plain, hand, lambda s, k: np.zeros(s.samples))
    assert found.keys() == {"pressure", "angle"}
    assert not any(each.broken for each in found.values()), found


@pytest.mark.parametrize("amount_deg", [0.15, 0.4])
def test_a_ripple_over_the_angle_breaks_one(amount_deg: float, plain: Signals, hand: Hand) -> None:
    """Fails when the Gaussian process misses a dependence on the angle that no parameter of the model has."""
    found = attacked(plain, hand, lambda s, k: amount_deg * DEGREE * np.sin(9.0 * s.angle_rad[:, k]))
    assert found["angle"].broken and found["angle"].model == GAUSSIAN_PROCESS and "angle" in found["angle"].over
    assert not found["pressure"].broken


def test_a_memory_of_the_pressure_breaks_one(plain: Signals, hand: Hand) -> None:
    """Fails when the lagged inputs miss a memory that no state at the same time shows: a play of the angle."""

    def play(signals: Signals, column: int) -> Array:
        out, half = np.empty(signals.samples), 4.0 * DEGREE
        at = float(signals.angle_rad[0, column])
        for k, angle in enumerate(signals.angle_rad[:, column]):
            at = min(max(at, angle - half), angle + half)
            out[k] = at
        return 0.15 * (out - signals.angle_rad[:, column])

    found = attacked(plain, hand, play)
    assert found["angle"].broken and found["angle"].model == LAGGED_INPUTS, found
    assert not found["pressure"].broken


def test_noise_that_is_correlated_breaks_none(plain: Signals, hand: Hand) -> None:
    """Fails when samples of a block count as independent: half a degree of drifting noise depends on no input."""
    rng = np.random.default_rng(SEED)

    def drifting(signals: Signals, column: int) -> Array:
        out = np.zeros(signals.samples)
        share = signals.period_s / 0.7
        for k in range(1, signals.samples):
            out[k] = (1.0 - share) * out[k - 1] + np.sqrt(2.0 * share) * 0.3 * DEGREE * rng.standard_normal()
        return out

    found = attacked(plain, hand, drifting)
    assert not any(each.broken for each in found.values()), found


def test_a_small_share_or_an_unsure_one_does_not_break() -> None:
    """Fails when one of the three conditions is not asked for: share, significance, size."""
    broken = Certificate(
        joint=JOINT, stage=1, model=GAUSSIAN_PROCESS, over=("angle",), before=0.01, after=0.005, sure=True, floor=0.001
    )
    assert broken.broken and broken.share == pytest.approx(0.5)
    limit = 0.01 * (1.0 - SETTINGS.certificate_share)
    for other in (replace(broken, after=limit + 1e-6), replace(broken, sure=False), replace(broken, floor=0.02)):
        assert not other.broken


@pytest.fixture(scope="module")
def half_explained(hand: Hand) -> tuple[Diagnosis, Hand]:
    """A joint with a load and a small ripple over the angle, which passes as an error of the form of the load."""
    rng = np.random.default_rng(SEED)
    nominal = off_by_a_little(hand, rng)
    signals = record(changed(hand, JOINT, constant_load__torque_nm=0.02), rng, SECONDS)
    column = signals.joints.index(JOINT)
    signals.angle_rad[:, column] += 0.3 * DEGREE * np.sin(9.0 * signals.angle_rad[:, column])
    without = [effect.name for effect in CATALOGUE if effect.name != "constant_load"]
    found = diagnose([signals], nominal, tolerance=0.05, seed=0, joints=[JOINT], without=without, sensor_curve=False)
    return found, nominal


def test_the_report_says_which_attack_takes_away_how_much(half_explained: tuple[Diagnosis, Hand]) -> None:
    """Fails when verdict, certificates and lines of a report contradict each other, or break its schema."""
    found, nominal = half_explained
    report = document(found, ["simulated"], nominal.path.name)
    validate(report, schema())
    broken = [row for row in report["certificates"] if not row["holds"]]
    print(found.verdict, report["certificates"], found.remainder)
    assert broken and found.verdict == "partly_explained" and not found.remainder
    assert broken[0]["share"] > SETTINGS.certificate_share
    assert broken[0]["rmse_after"] == pytest.approx((1.0 - broken[0]["share"]) * broken[0]["rmse_before"])
    assert any("a model without physics" in line for line in report["data_check"])
