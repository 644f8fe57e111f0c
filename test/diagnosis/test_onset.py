"""Effects that begin or end inside a recording are found with their time, and no others are."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hand_diagnosis.diagnosis import diagnose
from hand_diagnosis.judgement import onset
from hand_diagnosis.settings import SETTINGS
from hand_model.description import Hand
from hand_model.effects import CATALOGUE
from hand_recording.signals import Signals
from hand_sim.plant import PHI, HandPlant, P
from test.diagnosis.recordings import (
    ANGLE_NOISE_RAD,
    PERIOD_S,
    PRESSURE_NOISE_PA,
    changed,
    excitation,
    off_by_a_little,
)

JOINT, SECONDS, SEED = "index_distal", 20.0, 84
KEPT = ("leak", "valve_lag", "supply_droop", "pressure_gain", "coulomb_friction")
WITHOUT = [effect.name for effect in CATALOGUE if effect.name not in KEPT]
"""A short list of rivals: the times are tested here, and the names elsewhere."""


def recorded(first: Hand, then: Hand, at_s: float, rng: np.random.Generator) -> Signals:
    """A recording of a hand that is another one from at_s on, with noisy sensors."""
    commands = excitation(rng, SECONDS, len(first.joints))
    count = round(at_s / PERIOD_S)
    before = HandPlant(first, PERIOD_S)
    start = before.state[None].copy()
    first_part = before.advance(commands[:count])
    after = HandPlant(then, PERIOD_S, before.state)
    after.hold_history(commands[count - 1])
    states = np.concatenate([start, first_part, after.advance(commands[count:-1])])
    shape, yes = commands.shape, np.ones(commands.shape[1], dtype=bool)
    pressure = states[:, P] + PRESSURE_NOISE_PA * rng.standard_normal(shape)
    angle = states[:, PHI] + ANGLE_NOISE_RAD * rng.standard_normal(shape)
    known, none = np.ones(shape, dtype=bool), np.full(shape, np.nan)
    return Signals(
        name="simulated",
        joints=first.joints,
        period_s=PERIOD_S,
        set_point_pa=commands,
        pressure_pa=pressure,
        angle_rad=angle,
        force_n=none,
        known=known,
        has_set_point=yes,
        has_pressure=yes,
    )


@pytest.mark.long
@pytest.mark.parametrize(("begins", "at_s"), [(True, 11.3), (False, 9.1)])
def test_a_leak_that_begins_or_ends_is_found_with_its_time(begins: bool, at_s: float, hand: Hand) -> None:
    """Fails when the leak is not named, or its time is off by more than 0.3 s or four standard errors."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    leaking = changed(hand, JOINT, leak__rate_per_s=0.6)
    pair = (hand, leaking) if begins else (leaking, hand)
    signals = recorded(*pair, at_s, rng)
    model = off_by_a_little(hand, rng)
    result = diagnose([signals], model, tolerance=0.05, seed=0, joints=[JOINT], without=WITHOUT, sensor_curve=False)
    assert [finding.effect for finding in result.findings] == ["leak"], result.findings
    found = result.findings[0].onset
    assert found is not None
    assert found.begins is begins
    assert abs(found.at_s - at_s) < max(0.3, 4.0 * found.std_s)
    assert found.probability > 0.9
    assert ("It begins at" if begins else "It ends at") in result.findings[0].statement


def test_a_load_that_begins_moves_the_joint_to_a_new_place(hand: Hand) -> None:
    """Fails when a number of the plain plant cannot begin, or the way to the new place looks like another effect."""
    rng = np.random.default_rng(SEED)
    signals = recorded(hand, changed(hand, JOINT, constant_load__torque_nm=-0.03), 10.4, rng)
    model = off_by_a_little(hand, rng)
    kept = ("constant_load", "hall_misalignment", "leak", "coulomb_friction")
    without = [effect.name for effect in CATALOGUE if effect.name not in kept]
    result = diagnose([signals], model, tolerance=0.05, seed=0, joints=[JOINT], without=without, sensor_curve=False)
    assert [finding.effect for finding in result.findings] == ["constant_load"], result.findings
    found = result.findings[0].onset
    assert found is not None and found.begins
    assert abs(found.at_s - 10.4) < max(0.02, 4.0 * found.std_s)


def test_a_number_of_the_plain_plant_that_changes_is_named(hand: Hand) -> None:
    """Fails when a valve that becomes slower is taken for another fault of the valve, or was slower before."""
    rng = np.random.default_rng(SEED)
    slower = changed(hand, JOINT, valve__time_constant_s=0.08)
    signals = recorded(hand, slower, 8.2, rng)
    model = off_by_a_little(hand, rng)
    kept = ("valve_lag", "valve_deadband", "valve_flow_limit", "valve_hysteresis", "leak")
    without = [effect.name for effect in CATALOGUE if effect.name not in kept]
    result = diagnose([signals], model, tolerance=0.05, seed=0, joints=[JOINT], without=without, sensor_curve=False)
    assert [finding.effect for finding in result.findings] == ["valve_lag"], result.findings
    (finding,) = result.findings
    assert finding.onset is not None and finding.onset.begins
    assert abs(finding.onset.at_s - 8.2) < max(0.3, 4.0 * finding.onset.std_s)
    found = {number.key: number.value for number in finding.numbers}
    lags = found["valve.time_constant_s"] + found["valve_lag.time_constant_s"]
    assert lags == pytest.approx(0.08, rel=0.1)


def test_an_obstacle_that_begins_while_it_is_not_met_gets_the_middle_of_the_times(hand: Hand) -> None:
    """Fails when one end of the times that fit equally well is stated as the time, or with a small error."""
    rng = np.random.default_rng(SEED)
    obstacle = changed(hand, JOINT, contact__angle_deg=math.radians(70.0), contact__stiffness_nm_per_rad=2.0)
    signals = recorded(hand, obstacle, 10.7, rng)
    angle = signals.angle_rad[:, signals.joints.index(JOINT)]
    met_s = np.flatnonzero(angle > math.radians(69.5)) * PERIOD_S
    last_s, first_s = met_s[met_s < 10.7].max(), met_s[met_s > 10.7].min()
    assert first_s - last_s > 2.0
    without = [effect.name for effect in CATALOGUE if effect.name not in ("contact", "stiffening", "coulomb_friction")]
    model = off_by_a_little(hand, rng)
    result = diagnose([signals], model, tolerance=0.05, seed=0, joints=[JOINT], without=without, sensor_curve=False)
    assert [finding.effect for finding in result.findings] == ["contact"], result.findings
    found = result.findings[0].onset
    assert found is not None and found.begins
    assert abs(found.at_s - 0.5 * (last_s + first_s)) < 0.25 * (first_s - last_s)
    assert found.std_s > 0.2 * (first_s - last_s)


def test_a_leak_that_is_always_there_has_no_onset(hand: Hand) -> None:
    """Fails when an effect that is there all the time gets an onset, because it is little excited at first."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    leaking = changed(hand, JOINT, leak__rate_per_s=0.6)
    signals = recorded(leaking, leaking, 10.0, rng)
    model = off_by_a_little(hand, rng)
    result = diagnose([signals], model, tolerance=0.05, seed=0, joints=[JOINT], without=WITHOUT, sensor_curve=False)
    assert result.findings
    assert all(finding.onset is None for finding in result.findings)


@pytest.mark.parametrize("from_s", [0.0, 11.3], ids=["always there", "begins"])
def test_no_search_at_a_time_that_the_nominal_model_of_its_sound_side_contradicts(
    from_s: float, hand: Hand, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fails when a search is spent on a time before which the effect shows clearly, or is denied to the right one."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    leaking = changed(hand, JOINT, leak__rate_per_s=0.6)
    signals = recorded(hand if from_s else leaking, leaking, from_s or 11.3, rng)
    model = off_by_a_little(hand, rng)
    tried: list[onset.Onset] = []
    monkeypatch.setattr(onset, "_leaves_nothing", lambda search: False)
    monkeypatch.setattr(onset, "_candidates", lambda search, results: [onset.Onset(11.3, 0.0, True, 0.0)])
    monkeypatch.setattr(onset, "_tried", lambda search, candidate, rows, again: tried.append(candidate))
    diagnose([signals], model, tolerance=0.05, seed=0, joints=[JOINT], without=WITHOUT, sensor_curve=False)
    assert len(tried) == (from_s > 0.0)


def test_a_law_that_leaves_nothing_does_not_end_the_search_for_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when no time is sought because an effect without an onset, with a flexible law, fits the training data."""
    seen = onset.Onset(7.5, 0.0, begins=True, probability=0.0)
    monkeypatch.setattr(onset, "_change", lambda problem, nominal, begins: (9.0, seen) if begins else None)
    search = SimpleNamespace(problem=None, nominal=None, own_rows=(), accepted=["stiffening"])
    assert onset._candidates(search, []) == [seen]  # type: ignore[arg-type]
    search.accepted = []
    assert onset._candidates(search, []) == []  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("freed", "accepted", "gain", "sought"),
    [((), 1, 0.5, False), ((), 1, 1.5, True), (("stiffening.law_1",), 1, 0.5, True), ((), 2, 0.5, True)],
    ids=["nothing is left", "something is left", "by a law", "by two effects"],
)
def test_a_time_is_sought_where_it_could_explain_more(
    freed: tuple[str, ...], accepted: int, gain: float, sought: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fails when a time is sought that cannot explain more than one textbook effect does, or is not sought otherwise.

    gain: what it could explain, relative to what is asked for.
    """
    monkeypatch.setattr(onset, "most_to_gain", lambda problem, fit: gain * SETTINGS.min_onset_gain)
    found = [SimpleNamespace(freed=freed)] * accepted
    search = SimpleNamespace(problem=None, final=None, accepted=found)
    assert onset._leaves_nothing(search) is not sought  # type: ignore[arg-type]


def test_of_equal_evidence_an_effect_begins() -> None:
    """Fails when an effect that ends is as likely as one that begins, or much evidence for an end does not count."""
    always, prior = -50.0, float(np.log(SETTINGS.end_prior))
    begins, ends = (onset.Onset(7.5, 0.1, side, 0.0) for side in (True, False))
    for gain, expected in ((-0.5 * prior, begins), (-1.5 * prior, ends)):
        tries = [(-20.0, None, begins), (-20.0 + gain + prior, None, ends)]
        best = onset._best(tries, always)  # type: ignore[arg-type]
        assert best is not None and best[2] is expected
    assert onset._best([None, (always + 1.0, None, begins)], always) is None  # type: ignore[list-item]
