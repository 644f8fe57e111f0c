"""Test data: which they are, that no fit sees them, and that the model starts from a state estimated at their start."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hand_diagnosis import read_recording
from hand_diagnosis.diagnosis import diagnose, joint
from hand_diagnosis.judgement import CONTRADICTED
from hand_diagnosis.problem import ErrorsOnTest, Task, evaluate_test, exchanged, fit_part, spans_of_test, spared_last
from hand_diagnosis.report import document
from hand_diagnosis.search import JointSearch, search_joint
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import map_fit
from hand_model.description import Hand
from hand_model.effects import EFFECTS
from hand_recording.recording_files import RecordingError
from hand_recording.signals import Signals
from test.diagnosis import recordings
from test.diagnosis.recordings import ANGLE_NOISE_RAD, CONFIG, changed, excitation, record

JOINT = "index_distal"


@pytest.fixture(scope="module")
def signals(hand: Hand) -> Signals:
    return record(hand, np.random.default_rng(200), 20.0)


def test_the_last_fifth_or_a_whole_recording_is_spared(hand: Hand, signals: Signals) -> None:
    """Fails when test data are too few, reach into the fit part, or are taken from every one of many recordings."""
    whole = (
        Task(signals=[signals], model=hand, joints=[JOINT], effects=[], tolerance=0.05, seed=0, floors={})
        .prepare(JOINT)
        .problem
    )
    cut = spans_of_test(whole)[0][0]
    assert 0.7 < cut / signals.samples <= 0.8  # the cut is at the border of a block
    part = fit_part(whole)
    assert len(part.segments[0].angle_rad) == cut
    assert part.segments[0].block[-1] < whole.segments[0].block[cut]
    named = [replace(signals, name=name) for name in "abcd"]
    assert [each.name for each in spared_last(named)] == ["a", "b", "d", "c"]
    several = (
        Task(signals=spared_last(named), model=hand, joints=[JOINT], effects=[], tolerance=0.05, seed=0, floors={})
        .prepare(JOINT)
        .problem
    )
    assert [segment.name for segment in fit_part(several).segments] == ["a", "b", "d"]
    assert len(fit_part(several).segments[0].angle_rad) == signals.samples


def test_test_data_change_no_fit(hand: Hand, signals: Signals) -> None:
    """Fails when readings of the test data move the nominal numbers, or a fault in them is missed by the test error."""
    spoilt = signals.angle_rad.copy()
    spoilt[round(0.85 * signals.samples) :, hand.joints.index(JOINT)] += np.radians(3.0)
    fits, errors = [], []
    for angle in (signals.angle_rad, spoilt):
        ready = Task(
            signals=[replace(signals, angle_rad=angle)],
            model=hand,
            joints=[JOINT],
            effects=[],
            tolerance=0.05,
            seed=0,
            floors={},
        ).prepare(JOINT)
        fits.append(map_fit(fit_part(ready.problem), ready.free, ready.start, 6))
        tested = evaluate_test(ready.problem, [fits[-1]], free_axis=False)
        assert tested is not None
        errors.append(float(tested.rmse(0)[1]))
    # The noise of a reading is estimated over the whole recording, so the weights of the data are not quite the same.
    np.testing.assert_allclose(fits[0].z, fits[1].z, atol=0.03)
    assert errors[0] < 1.5 * ANGLE_NOISE_RAD
    assert errors[1] > np.radians(1.0)


def test_exchanged_test_data_change_no_fit(hand: Hand, signals: Signals) -> None:
    """Fails when readings of test data inside a recording are fitted, or the end of the recording is not."""
    ready = Task(signals=[signals], model=hand, joints=[JOINT], effects=[], tolerance=0.05, seed=0, floors={}).prepare(
        JOINT
    )  # its inputs come from the usual split
    usual = spans_of_test(ready.problem)[0]
    begin = 2 * usual[0] - usual[1]
    read = ready.problem.segments[0]
    spoilt = read.angle_rad.copy()
    spoilt[begin + 150 : usual[0]] += np.radians(3.0)
    fits, errors = [], []
    for angle in (read.angle_rad, spoilt):
        whole = exchanged(replace(ready.problem, segments=[replace(read, angle_rad=angle)]))
        assert whole is not None and exchanged(whole) is None
        span = spans_of_test(whole)[0]
        assert begin <= span[0] + 250 and span[1] == usual[0]
        part = fit_part(whole)
        assert not part.segments[0].use[:, span[0] : span[1]].any()
        assert part.segments[0].use[1, usual[0] :].any()
        fits.append(map_fit(part, ready.free, ready.start, 25, 1e-6))
        tested = evaluate_test(whole, [fits[-1]], free_axis=False)
        assert tested is not None
        errors.append(float(tested.rmse(0)[1]))
    np.testing.assert_allclose(fits[0].z, fits[1].z, atol=1e-6)
    assert errors[0] < 1.5 * ANGLE_NOISE_RAD
    assert errors[1] > np.radians(1.0)


def test_an_obstacle_met_only_at_the_end_is_found(hand: Hand, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when what only the last fifth of a recording shows gets no name, or the report is silent about it."""
    seed, seconds = 202, 24.0
    print(f"seed {seed}")

    def gentle_first(rng: np.random.Generator, seconds: float, joints: int) -> np.ndarray:
        commands = excitation(rng, seconds, joints)
        commands[: round(0.8 * len(commands))] *= 0.4
        return commands

    monkeypatch.setattr(recordings, "excitation", gentle_first)
    column = hand.joints.index(JOINT)
    plain = record(hand, np.random.default_rng(seed), seconds)
    last, _ = spans_of_test(
        Task(signals=[plain], model=hand, joints=[JOINT], effects=[], tolerance=0.05, seed=0, floors={})
        .prepare(JOINT)
        .problem
    )[0]
    before, after = (float(part.max()) for part in (plain.angle_rad[:last, column], plain.angle_rad[last:, column]))
    print(np.degrees([before, after]))
    at_rad = before + 0.2 * (after - before)
    blocked = changed(hand, JOINT, contact__angle_deg=at_rad, contact__stiffness_nm_per_rad=0.5)
    met = record(blocked, np.random.default_rng(seed), seconds)
    result = diagnose([met], hand, tolerance=0.05, seed=0, joints=[JOINT], sensor_curve=False)
    assert result.joints[0].whole is not None and result.joints[0].whole.spared is not None
    assert {finding.effect for finding in result.findings} & {"contact", "end_stop"}
    assert any("only the last part of the recording shows" in line for line in result.check)


@pytest.mark.parametrize("again", [False, True], ids=["once", "twice"])
def test_what_test_data_contradict_is_sought_with_them(
    hand: Hand, monkeypatch: pytest.MonkeyPatch, again: bool
) -> None:
    """Fails when a model that does not hold where only test data move so gets no second try, or passes without one."""
    seed, asked, real = 203, [], joint.tested  # type: ignore[attr-defined]
    print(f"seed {seed}")

    def contradicting(whole: JointProblem, search: JointSearch, *rest: Any, **options: Any) -> Any:
        test, withdrawn = real(whole, search, *rest, **options)
        asked.append(whole.spared)
        if whole.spared is not None and not again:
            return test, withdrawn
        names = [hypothesis.effect.name for hypothesis in search.accepted]
        search.accepted.clear()
        return test, tuple((name, CONTRADICTED) for name in names)

    monkeypatch.setattr(joint, "tested", contradicting)
    rubbing = changed(hand, JOINT, coulomb_friction__torque_nm=4e-3)
    result = diagnose(
        [record(rubbing, np.random.default_rng(seed), 20.0)], hand, tolerance=0.05, seed=0, joints=[JOINT],
        without=[name for name in EFFECTS if name != "coulomb_friction"], sensor_curve=False,
    )  # fmt: skip
    assert len(asked) == 2 and asked[0] is None and asked[1] is not None
    assert [finding.effect for finding in result.findings] == ([] if again else ["coulomb_friction"])
    assert any("only the last part of the recording shows" in line for line in result.check) is not again


def test_a_joint_that_fails_does_not_cost_the_report(
    hand: Hand, signals: Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fails when one joint's failure ends the diagnosis, or the report is silent about it."""
    search = search_joint

    def failing(problem, *rest, **laws):  # type: ignore[no-untyped-def]
        if problem.joint == JOINT:
            raise ValueError("no sense in it")
        return search(problem, *rest, **laws)

    monkeypatch.setattr(joint, "search_joint", failing)
    joints = [JOINT, "thumb_opposition"]
    result = diagnose([signals], hand, tolerance=0.05, seed=0, joints=joints, sensor_curve=False)
    assert [joint.joint for joint in result.joints] == ["thumb_opposition"]
    content = document(result, ["run"], "hand.yaml")
    assert content["not_judged"] == [{"joint": JOINT, "reason": "its diagnosis failed: no sense in it"}]


def test_a_little_more_of_one_signal_outweighs_no_large_gain_of_another() -> None:
    """Fails when an effect is withdrawn for a rise of the angle far below its repeatability, or not for a large one."""
    floor, counts = np.array([300.0, 1e-3, 0.05]), np.full((3, 4), 100.0)
    before = np.array([[2000.0**2, 0.0, 0.0, 0.0], [7.2e-4**2] * 4, [np.nan] * 4]) * counts
    after = np.array([[300.0**2, 0.0, 0.0, 0.0], [7.9e-4**2] * 4, [np.nan] * 4]) * counts
    harmful = np.array([[2000.0**2, 0.0, 0.0, 0.0], [7.9e-3**2] * 4, [np.nan] * 4]) * counts
    rng = np.random.default_rng(3)
    assert not ErrorsOnTest((before, after), counts).clearly_worse(0, 1, floor, rng)
    assert ErrorsOnTest((before, harmful), counts).clearly_worse(0, 1, floor, rng)
    few = ErrorsOnTest((before[:, :2], harmful[:, :2]), counts[:, :2])
    assert not few.clearly_worse(0, 1, floor, rng)  # too few blocks to say so


def test_the_report_names_its_splits(hand: Hand) -> None:
    """Fails when the error on test data is not reported, or a name of schema 1 is left."""
    seed = 201
    print(f"seed {seed}")
    rubbing = record(changed(hand, JOINT, coulomb_friction__torque_nm=0.012), np.random.default_rng(seed), 24.0)
    result = diagnose([rubbing], hand, tolerance=0.05, seed=0, joints=[JOINT], sensor_curve=False)
    content = document(result, ["run"], "hand.yaml")
    assert content["schema"] == 2
    rows = {(row["signal"], row["split"]): row for row in content["fit"]}
    assert {split for _, split in rows} == {"train", "validation", "test"}
    angle = rows["angle", "test"]
    assert angle["rmse_after"] < 0.2 * angle["rmse_before"]
    first = content["findings"][0]
    assert (first["effect"], first["tied_with"], first["since"]) == ("coulomb_friction", [], None)
    assert first["explains"] > 0.95
    assert f"to {angle['rmse_after']:.3g} deg" in first["statement"]


def test_a_missing_recording_is_one_line() -> None:
    """Fails when the Python interface gives another error than the command for a file that cannot be used."""
    with pytest.raises((RecordingError, OSError), match=r"nowhere\.mcap"):
        read_recording("nowhere.mcap", CONFIG)
