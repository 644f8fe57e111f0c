"""The contact detector step by step: bias, sum, alarm, release, threshold, and contradiction by motion."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from hand_control.contact import contradicted_by_motion, detect, threshold
from hand_control.declared import C, G, S, Settings
from hand_control.tuning import gains
from hand_model.arrays import Array
from hand_model.description import load_hand

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
DT_S, STD_NM = 0.005, 0.01


def joint(level: float = 5.0) -> tuple[Array, Array]:
    g = np.repeat(gains(HAND, Settings.of(HAND, {}))[:, :1], 2, axis=1)
    g[G.threshold] = level
    return g, np.zeros((len(S), 2))


@pytest.mark.parametrize("lags", [False, True])
def test_the_sum_follows_page_until_the_alarm(lags: bool) -> None:
    """Fails when allowance, weight, alarm, age or bias differ from S' = max(0, S + (z - K) dt / (2 T))."""
    g, s = joint()
    rng = np.random.default_rng(2)
    bias = total = age = 0.0
    alarms = 0
    for k in range(400):
        balance = 0.01 * rng.standard_normal() + (0.06 if k > 200 else 0.0)
        z = (balance - bias) / STD_NM
        age = age + DT_S if total > 0.0 else 0.0
        allowance = C.allowance if lags else C.free_allowance
        total = min(max(total + (z - allowance) * DT_S / (2.0 * g[G.observer_filter, 1]), 0.0), 10.0)
        if total < 2.5 and not (lags and balance > bias):
            bias += DT_S / (DT_S + C.bias_time) * (balance - bias)
        detect(g, s, 1, balance, STD_NM**2, False, lags, DT_S)
        assert s[S.sum, 1] == pytest.approx(total) and s[S.age, 1] == pytest.approx(age)
        assert s[S.bias, 1] == pytest.approx(bias)
        assert s[S.contact, 1] == float(total > 5.0)
        alarms += total > 5.0
        if alarms:
            break
    assert alarms and 200 < k < 300 and not s[:, 0].any()


def test_the_sum_is_bounded_at_twice_the_threshold() -> None:
    """Fails when a strong contact sums so far that its end is not noticed for long."""
    g, s = joint()
    for _ in range(200):
        detect(g, s, 1, 10.0, STD_NM**2, False, False, DT_S)
    assert s[S.sum, 1] == 10.0 and s[S.contact, 1] == 1.0
    assert s[S.age, 1] == pytest.approx(199 * DT_S)


def test_the_bias_stops_between_half_the_threshold_and_the_alarm() -> None:
    """Fails when the bias follows the beginning of a contact and hides it."""
    for share, follows in ((0.4, True), (0.6, False)):
        g, s = joint()
        s[S.sum, 1] = share * 5.0
        detect(g, s, 1, C.free_allowance * STD_NM, STD_NM**2, False, False, DT_S)
        assert (s[S.bias, 1] != 0.0) == follows


def test_what_holds_a_joint_back_never_becomes_a_bias() -> None:
    """Fails when a torque that grows slowly, at a joint that its reference leaves behind, is taken for the model's."""
    alarms = []
    for lags in (False, True):
        g, s = joint(2.0)
        for k in range(600):
            detect(g, s, 1, 0.04 * k / 600, STD_NM**2, False, lags, DT_S)
        alarms.append(s[S.contact, 1] == 1.0)
    assert alarms == [False, True]
    bias = s[S.bias, 1]
    s[S.contact, 1] = s[S.sum, 1] = 0.0
    detect(g, s, 1, -0.01, STD_NM**2, False, True, DT_S)
    assert s[S.bias, 1] < bias


def test_a_contact_ends_after_the_release_time_below_the_release_level() -> None:
    """Fails when a contact ends too early, too late, after an interrupted release, or keeps its sum and age."""
    g, s = joint()
    s[S.contact, 1], s[S.sum, 1], s[S.age, 1] = 1.0, 9.0, 1.0
    held, gone = (C.release + 0.01) * STD_NM, (C.release - 0.01) * STD_NM
    count = round(C.release_time / DT_S)
    for _ in range(3 * count):
        detect(g, s, 1, held, STD_NM**2, False, False, DT_S)
    assert s[S.contact, 1] == 1.0 and s[S.released, 1] == 0.0 and s[S.bias, 1] == 0.0
    for _ in range(count - 1):
        detect(g, s, 1, gone, STD_NM**2, False, False, DT_S)
    detect(g, s, 1, held, STD_NM**2, False, False, DT_S)
    ticks = 0
    while s[S.contact, 1] == 1.0:
        detect(g, s, 1, gone, STD_NM**2, False, False, DT_S)
        ticks += 1
        assert ticks < 10 * count
    assert ticks == pytest.approx(count + 1, abs=1)
    assert s[S.sum, 1] == 0.0 and s[S.age, 1] == 0.0


def test_a_new_contact_begins_without_an_old_release_time() -> None:
    """Fails when the time without torque of an earlier contact shortens the next one."""
    g, s = joint()
    s[S.sum, 1], s[S.released, 1] = 5.0, 0.09
    detect(g, s, 1, 1.0, STD_NM**2, False, False, DT_S)
    assert s[S.contact, 1] == 1.0 and s[S.released, 1] == 0.0


def test_a_joint_that_extends_as_commanded_meets_no_obstacle() -> None:
    """Fails when an error of the drag makes a contact of a fast release, or extension hides the end of a contact."""
    g, s = joint()
    for _ in range(100):
        detect(g, s, 1, 1.0, STD_NM**2, True, False, DT_S)
    assert s[S.sum, 1] == s[S.contact, 1] == 0.0
    detect(g, s, 1, 1.0, STD_NM**2, False, False, DT_S)
    before = s[S.sum, 1]
    detect(g, s, 1, -1.0, STD_NM**2, True, False, DT_S)
    assert s[S.sum, 1] < before
    s[S.contact, 1] = 1.0
    detect(g, s, 1, 1.0, STD_NM**2, True, False, DT_S)
    assert s[S.sum, 1] > 0.0


def test_negative_balances_widen_the_expected_ones() -> None:
    """Fails when friction, which shows in both directions, is not learnt, or a contact or an end stop teaches it."""
    g, s = joint()
    s[S.phi_2] = 0.7
    detect(g, s, 1, 0.006, STD_NM**2, False, False, DT_S)
    assert s[S.misfit, 1] == 0.0  # it could be an obstacle
    for _ in range(round(10.0 * C.misfit_time / DT_S)):
        detect(g, s, 1, -0.006, STD_NM**2, False, False, DT_S)
    assert s[S.misfit, 1] == pytest.approx(0.006**2, rel=0.01)
    s[S.phi_2, 1] = g[G.low, 1]
    detect(g, s, 1, -0.5, STD_NM**2, False, False, DT_S)
    assert s[S.misfit, 1] == pytest.approx(0.006**2, rel=0.01)
    s[S.phi_2, 1] = 0.7
    for _ in range(round(10.0 * C.misfit_time / DT_S)):
        detect(g, s, 1, -0.5, STD_NM**2, False, False, DT_S)
    assert s[S.misfit, 1] == pytest.approx((C.most_residual * g[G.residual_std, 1]) ** 2, rel=0.01)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_motion_as_commanded_ends_a_contact(direction: float) -> None:
    """Fails when a joint that follows its reference stays in contact, or the contact ends before the declared time."""
    s = np.zeros((len(S), 2))
    s[[S.contact, S.sum, S.age], 1] = 1.0, 9.0, 2.0
    reference = direction * 0.5
    ticks = 0
    while not contradicted_by_motion(s, 1, reference, reference * 0.51, DT_S):
        assert s[S.contact, 1] == 1.0
        ticks += 1
        assert ticks < 100
    assert ticks == pytest.approx(C.moving_time / DT_S, abs=1)
    assert not s[[S.contact, S.sum, S.age, S.moving], 1].any()


@pytest.mark.parametrize(
    ("reference", "speed", "contact"),
    [(0.29, 0.29, 1.0), (-0.29, -0.29, 1.0), (0.5, 0.24, 1.0), (0.5, -0.5, 1.0), (-0.5, 0.5, 1.0), (0.5, 0.5, 0.0)],
)
def test_other_motion_does_not_contradict_a_contact(reference: float, speed: float, contact: float) -> None:
    """Fails when a slow reference, a joint that lags or moves back, or a free joint ends a contact."""
    s = np.zeros((len(S), 2))
    s[S.contact, 1], s[S.sum, 1] = contact, 3.0
    s[S.moving, 1] = 0.09
    for _ in range(100):
        assert not contradicted_by_motion(s, 1, reference, speed, DT_S)
    assert s[S.moving, 1] == 0.0 and s[S.contact, 1] == contact and s[S.sum, 1] == 3.0


@pytest.mark.parametrize("rate", [0.01, 1.0, 60.0])
@pytest.mark.parametrize("filter_s", [0.01, 0.05])
def test_the_threshold_gives_the_run_length_of_siegmund(rate: float, filter_s: float) -> None:
    """Fails when h does not satisfy ARL = (exp(2 K b) - 2 K b - 1) / (2 K^2) for the wanted rate of false alarms."""
    exponent = 2.0 * C.allowance * (threshold(rate, filter_s) + 1.166)
    run_length = (math.exp(exponent) - exponent - 1.0) / (2.0 * C.allowance**2)
    assert run_length * 2.0 * filter_s * rate == pytest.approx(3600.0, rel=1e-6)


def test_the_highest_rate_of_false_alarms_has_a_threshold() -> None:
    """Fails when an allowed pair of parameters, at which even h = 0 alarms too seldom, is an error."""
    assert threshold(3600.0, 1.0) == 0.0
    assert threshold(3600.0, 0.02) > 0.0
