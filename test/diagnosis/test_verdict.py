"""The probability of a name by what it leaves of data that were not fitted."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import pytest

from hand_diagnosis.judgement import Excess, Finding, StageResult, verdict
from hand_diagnosis.settings import SETTINGS

FLOOR, NOISE = 1.0, 0.2


def result(before: float, after: float) -> StageResult:
    """A signal with one effect: its excess error before and after, in floors."""
    errors = math.hypot(before, NOISE), math.hypot(after, NOISE)
    return StageResult(
        stage=1,
        before=errors[0],
        after=errors[1],
        noise=NOISE,
        excess_before=before,
        excess_after=after,
        floor=FLOOR,
        effects=1,
        independent=40.0,
    )


def test_a_recording_without_a_diagnosed_joint_does_not_agree() -> None:
    """Fails when joints that could not be compared with the model pass for joints that agree with it."""
    assert verdict([], [], 0) == "unusable"
    assert verdict([], [], 1) == "agrees"


def test_lost_frames_explain_no_difference() -> None:
    """Fails when a recording that the model predicts is called explained because frames are missing."""
    lost, friction = (cast("Finding", SimpleNamespace(effect=name)) for name in ("dropped_frames", "coulomb_friction"))
    assert verdict([lost], [], 1) == "agrees"
    assert verdict([lost, friction], [], 1) == "explained"


def test_a_name_that_leaves_much_is_improbable() -> None:
    """Fails when a name that leaves half of a large error stays sure, or one that leaves only noise does not."""
    assert result(40.0, 0.1).right_name > 0.9
    assert result(40.0, 20.0).right_name < 0.25
    steps = [result(40.0, left).right_name for left in (0.0, 1.0, 2.0, 4.0, 8.0, 16.0)]
    assert steps == sorted(steps, reverse=True)


def test_the_worse_of_validation_and_test_data_counts() -> None:
    """Fails when a law that fits what it saw and misses the test data keeps its probability, or the reverse."""
    fits, misses = result(40.0, 0.1), result(40.0, 20.0)
    good, bad = (Excess("test", 40.0, left, 40.0, NOISE) for left in (0.0, 20.0))
    assert replace(fits, elsewhere=(bad,)).right_name == pytest.approx(misses.right_name)
    assert replace(misses, elsewhere=(good,)).right_name == pytest.approx(misses.right_name)
    assert replace(fits, elsewhere=(replace(bad, split="train"),)).right_name == fits.right_name


@pytest.mark.parametrize(
    ("train", "test", "late"), [(0.1, 20.0, True), (5.0, 20.0, True), (10.0, 20.0, False), (10.0, 0.1, False)]
)
def test_what_shows_several_times_more_on_test_data_shows_late(train: float, test: float, late: bool) -> None:
    """Fails when an end of a recording that shows what its beginning hardly does is not fitted, or any other one is."""
    splits = [Excess(name, 40.0, left, 40.0, NOISE) for name, left in (("train", train), ("test", test))]
    assert replace(result(40.0, 0.1), elsewhere=tuple(splits)).shows_late is late


def test_half_way_where_the_tolerated_error_is_left() -> None:
    """Fails when what a right name may leave is not two floors, and a tenth of a large error, as settings.md says."""
    for before in (5.0, 100.0):
        tolerated = math.hypot(SETTINGS.name_excess_floors, SETTINGS.tolerated_share * before)
        half_way = 0.5 * (1.0 + SETTINGS.name_least)
        assert result(before, tolerated).right_name == pytest.approx(half_way)
        assert half_way <= 0.6, "a stand-in that leaves so much is not misleading"


def test_a_name_keeps_a_chance_whatever_it_leaves() -> None:
    """Fails when a right class whose law has another form is called impossible."""
    left = result(1e4, 1e4).right_name
    assert left == pytest.approx(SETTINGS.name_least, abs=0.01)


@pytest.mark.parametrize("split", ["train", "test"])
def test_what_is_left_counts_wherever_it_is(split: str) -> None:
    """Fails when an error that only training or only test data show is no remainder, or its split is not named."""
    quiet = replace(result(20.0, 0.1), elsewhere=(Excess(split, 20.0, 0.5, 40.0, 1.0),))
    assert not quiet.remains and quiet.other_physics < 0.2
    loud = replace(quiet, elsewhere=(Excess(split, 20.0, 15.0, 40.0, 1.0),))
    assert loud.remains and loud.other_physics > 0.8
    assert loud.most_left.split == split and loud.claimed, "what validation data confirm stays a finding"


def test_what_test_data_confirm_is_a_finding_next_to_its_remainder() -> None:
    """Fails when an event in one validation block hides an effect that most of the test error shows, or a test error
    within the repeatability counts.
    """
    hidden = result(8.0, 7.5)
    assert hidden.remains and not hidden.claimed
    confirmed = replace(hidden, elsewhere=(Excess("test", 5.0, 1.5, 40.0, NOISE),))
    assert confirmed.remains and confirmed.claimed
    assert not replace(hidden, elsewhere=(Excess("test", 5.0, 4.0, 40.0, NOISE),)).claimed
    assert not replace(hidden, elsewhere=(Excess("test", 0.8, 0.1, 40.0, NOISE),)).claimed
    assert not replace(hidden, elsewhere=(Excess("train", 5.0, 0.1, 40.0, NOISE),)).claimed, "the fit has seen it"
