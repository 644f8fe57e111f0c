"""Predictions of a hand by a model that is not fitted."""

from __future__ import annotations

import numpy as np
import pytest

from hand_diagnosis.prediction import document, predict
from hand_model.description import load_hand
from test.diagnosis.recordings import ANGLE_NOISE_RAD, CONFIG, changed, record

JOINT = "index_proximal"


def test_the_right_model_predicts_to_the_noise_and_a_wrong_one_does_not() -> None:
    """Fails when the prediction of a hand is not that of its model, or a number of the model is fitted."""
    hand = load_hand(CONFIG)
    truth = changed(hand, JOINT, coulomb_friction__torque_nm=0.02)
    recorded = record(truth, np.random.default_rng(4), 12.0)
    scores = {}
    for name, model in (("right", truth), ("wrong", hand)):
        content = document(predict([recorded], model, joints=[JOINT]), ["a"], "b")
        scores[name] = next(row for row in content["scores"] if row["signal"] == "angle")
    noise_deg = np.degrees(ANGLE_NOISE_RAD)
    assert scores["right"]["rmse"] < 1.5 * noise_deg
    assert scores["right"]["noise_floor"] == pytest.approx(noise_deg, rel=0.5)
    assert scores["wrong"]["rmse"] > 10.0 * noise_deg


def test_an_unknown_joint_is_named() -> None:
    """Fails when a joint that was not recorded is left out in silence."""
    hand = load_hand(CONFIG)
    recorded = record(hand, np.random.default_rng(4), 2.0)
    with pytest.raises(ValueError, match="'toe' was not recorded"):
        predict([recorded], hand, joints=["toe"])
