"""Impacts on end stops do not count; what comes slowly, or rests there, does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_identification.impacts import hitting, impacts, lasting
from hand_identification.joint_data import joint_problem
from hand_identification.settings import FITS
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_recording.signals import Signals
from test.diagnosis.recordings import record

CONFIG = Path(__file__).parents[2] / "config" / "hand.yaml"
PERIOD_S = 0.005
LOW, HIGH = np.radians(-10.0), np.radians(100.0)


def arriving(speed_rad_s: float, at_rad: float = HIGH) -> Array:
    """Angles (T,) [rad] of a joint that moves to a stop at a steady speed and rests there."""
    time_s = np.arange(0.0, 4.0, PERIOD_S)
    return np.asarray(np.sign(at_rad) * np.minimum(speed_rad_s * time_s, abs(at_rad)))


@pytest.mark.parametrize("at_rad", [LOW, HIGH])
def test_only_a_fast_joint_hits_a_stop(at_rad: float) -> None:
    """Fails when an impact on either stop is missed, or a slow arrival, a rest or a fast motion elsewhere counts."""
    fast = hitting(arriving(3.0, at_rad), PERIOD_S, LOW, HIGH)
    arrives = abs(at_rad) / 3.0 / PERIOD_S
    assert fast[round(arrives) - 2]
    assert not fast[round(arrives) + 10 :].any() and not fast[: round(arrives - 0.1 / 3.0 / PERIOD_S)].any()
    assert not hitting(arriving(0.5, at_rad), PERIOD_S, LOW, HIGH).any()
    assert not hitting(arriving(3.0, np.radians(80.0)), PERIOD_S, LOW, HIGH).any()


def test_what_follows_a_flag_is_flagged() -> None:
    """Fails when the time after an impact is too short, too long, or begins before it."""
    hits = np.zeros(20, dtype=bool)
    hits[[5, 6, 15]] = True
    assert np.flatnonzero(lasting(hits, 3)).tolist() == [*range(5, 10), *range(15, 19)]
    assert not lasting(np.zeros(5, dtype=bool), 3).any()


@pytest.fixture(scope="module")
def hand() -> Hand:
    return load_hand(CONFIG)


@pytest.fixture(scope="module")
def signals(hand: Hand) -> Signals:
    """A recording in which index_distal alone hits its stop, once, after 3 s."""
    made = record(hand, np.random.default_rng(3), 12.0)
    angle = np.clip(made.angle_rad, np.radians(-3.0), np.radians(60.0))
    column, first = made.joints.index("index_distal"), round(3.0 / made.period_s)
    whole = arriving(3.0)[: made.samples - first]
    angle[first : first + len(whole), column] = whole
    angle[:first, column], angle[first + len(whole) :, column] = 0.0, whole[-1]
    return replace(made, angle_rad=angle)


@pytest.mark.parametrize(("joint", "hit"), [("index_distal", True), ("index_proximal", True), ("ring_distal", False)])
def test_an_impact_counts_for_neither_phalanx(hand: Hand, signals: Signals, joint: str, hit: bool) -> None:
    """Fails when the angle of the joint that hits a stop, or of its partner, counts then, or another one does not."""
    after = impacts(signals, hand, joint)
    assert after.any() == hit
    use = joint_problem([signals], hand, joint).segments[0].use
    settled = np.arange(signals.samples) > FITS.settling_s / signals.period_s
    assert not use[1][after].any() and use[1][settled & ~after].all() and use[0][settled].all()
    if hit:
        arrives_s = 3.0 + HIGH / 3.0
        assert np.flatnonzero(after)[-1] * signals.period_s == pytest.approx(arrives_s + FITS.impact_s, abs=0.05)


def test_a_machine_has_no_stops_to_hit(hand: Hand, signals: Signals) -> None:
    """Fails when an axis that turns on and on loses its data where stops would be that it does not have."""
    assert impacts(signals, hand, "index_distal").any()
    assert not impacts(replace(signals, machine=True), hand, "index_distal").any()
