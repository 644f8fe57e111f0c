"""model.yaml of a report always loads: numbers that are no valid description are left out, joint by joint."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from hand_diagnosis.diagnosis import valid_changes
from hand_identification.model_file import write_model
from hand_model.description import load_hand
from hand_model.yaml_loader import DescriptionError
from test.diagnosis.recordings import CONFIG

GOOD, BAD = {"coulomb_friction.torque_nm": 2e-3}, {"valve.fill_rate_pa_per_s": -1.0}
"""Numbers of an effect, and a rate of a valve that no description allows."""


def test_numbers_that_are_no_description_are_left_out(tmp_path: Path) -> None:
    """Fails when one joint's numbers spoil the file, take those of another joint with them, or leave without a word."""
    hand, out = load_hand(CONFIG), tmp_path / "model.yaml"
    first, second, third = hand.joints[:3]

    def write(changes: Mapping[str, Mapping[str, float]]) -> None:
        write_model(hand, changes, out, "")

    wanted: dict[str, Mapping[str, float]] = {first: GOOD, second: {**GOOD, **BAD}, third: BAD}
    with pytest.raises(DescriptionError):
        write(wanted)
    effects = {first: frozenset(GOOD), second: frozenset(GOOD), third: frozenset(BAD)}
    kept, lines = valid_changes(wanted, effects, write)
    assert kept == {first: GOOD, second: GOOD}
    assert [line.split(": ")[:2] for line in lines] == [
        [second, "model.yaml is without the changed nominal numbers"],
        [third, "model.yaml is without what was found"],
    ]
    write(kept)
    assert load_hand(out).joints == hand.joints
