"""The sentence over a report: the answer, what is uncertain about it, and what was not diagnosed."""

from __future__ import annotations

from typing import Any

import pytest

from hand_diagnosis.pages.drawing import tint
from hand_diagnosis.pages.headline import heat_map, ties, tiles, title, worst_by_joint
from hand_diagnosis.settings import SETTINGS

FRICTION = {
    "joint": "index_distal",
    "effect": "coulomb_friction",
    "probability": 0.96,
    "alternatives": [{"effect": "backlash", "probability": 0.03}],
    "tied_with": [],
    "explains": 0.98,
    "where": {"signal": "angle"},
    "parameters": {"coulomb_friction.torque_nm": {"value": 0.0119, "std": 3e-4, "unit": "N m", "determined": True}},
}
ANSWER = "index_distal: Coulomb friction of 0.0119 ± 0.0003 N m (96%)"
TIED = FRICTION | {
    "effect": "leak",
    "probability": 0.55,
    "alternatives": [{"effect": "pressure_gain", "probability": 0.4}],
    "tied_with": ["pressure_gain"],
}
RESTING = [{"joint": f"joint_{k}", "reason": "moved too little"} for k in range(5)]
REMAINDER = {"joint": "index_distal", "signal": "angle", "rms": 0.83, "unit": "deg"}


def row(joint: str, before: float, after: float, split: str = "test") -> dict[str, Any]:
    errors = {"rmse_before": before, "rmse_after": after, "noise_floor": 0.01, "undetermined": 0.0}
    return {"joint": joint, "signal": "angle", "unit": "deg", "split": split} | errors


def report(**parts: Any) -> dict[str, Any]:
    empty = {
        "findings": [],
        "remainder": [],
        "not_judged": [],
        "next_experiment": None,
        "fit": [row("index_distal", 2.8, 0.03)],
    }
    return empty | parts


LOST = FRICTION | {"joint": None, "effect": "dropped_frames", "probability": 0.99, "parameters": {}}
NOTHING = {"value": 0.0, "std": 0.005, "unit": "s", "determined": True}
SLOW = FRICTION | {
    "effect": "valve_lag",
    "parameters": {"valve_lag.time_constant_s": NOTHING, "valve.time_constant_s": NOTHING | {"value": 0.187}},
}


@pytest.mark.parametrize(
    ("parts", "expected"),
    [
        ({"findings": [FRICTION]}, ANSWER),
        ({"findings": [SLOW]}, "index_distal: valve lag of 0.187 ± 0.005 s (96%)"),
        (
            {"findings": [SLOW | {"parameters": {"valve_lag.time_constant_s": NOTHING}}]},
            "index_distal: valve lag (96%)",
        ),
        (
            {"findings": [TIED]},
            "index_distal: leak (55%) or pressure gain (40%), which this recording cannot distinguish",
        ),
        (
            {"findings": [FRICTION | {"probability": 0.01}], "remainder": [REMAINDER]},
            "index_distal: 0.83 deg of the angle that no known effect explains; "
            "perhaps index_distal: Coulomb friction of 0.0119 ± 0.0003 N m (1%)",
        ),
        ({}, "Model and recording agree: no effect of the catalogue is missing"),
        (
            {"fit": [], "not_judged": [{"joint": "a", "reason": "b"}]},
            "Nothing could be diagnosed; 1 of 1 joints not diagnosed",
        ),
        (
            {"findings": [LOST], "fit": [], "not_judged": [{"joint": "a", "reason": "b"}]},
            "Nothing could be diagnosed; the hand: dropped frames (99%); 1 of 1 joints not diagnosed",
        ),
        (
            {"findings": [LOST]},
            "Model and recording agree: no effect of the catalogue is missing; the hand: dropped frames (99%)",
        ),
        ({"not_judged": RESTING}, "index_distal agrees with the model; 5 of 6 joints not diagnosed"),
        ({"findings": [FRICTION] * 3}, f"{ANSWER}; {ANSWER}; and 1 more"),
    ],
    ids=[
        "named",
        "second number",
        "no number",
        "tied",
        "unlikely",
        "agrees",
        "nothing",
        "stamps",
        "lost",
        "a part",
        "many",
    ],
)
def test_the_title_is_the_answer(parts: dict[str, Any], expected: str) -> None:
    """Fails when a tie is named as certain, an unlikely name comes first, or a joint is left out in silence."""
    assert title(report(**parts)) == expected


def test_the_title_says_where_test_data_hardly_check_the_findings() -> None:
    """Fails when a fit that leaves most of the prediction open reads like one that test data confirm."""
    free, sure = row("index_distal", 2.8, 2.7) | {"undetermined": 2.6}, row("index_distal", 2.8, 0.03)
    line = "test data hardly check index_distal: the fit leaves 2.6 deg of the angle open"
    assert title(report(findings=[FRICTION], fit=[sure, free])) == f"{ANSWER}; {line}"
    for other in (free | {"undetermined": 1.3}, free | {"split": "train"}, free | {"joint": "ring_distal"}):
        assert title(report(findings=[FRICTION], fit=[sure, other])) == ANSWER
    pressure = free | {"signal": "pressure"}
    assert title(report(findings=[FRICTION], fit=[sure, pressure])) == ANSWER


def test_every_tie_comes_with_its_command_or_the_reason_for_none() -> None:
    """Fails when a tie is not pointed out, a finding without one is, or a tie gets the command of another."""
    one = {"name": "slow_triangle", "why": "separates leak from pressure_gain on index_distal", "command": "hand one"}
    other = {"name": "hold", "why": "separates leak from pressure_gain on ring_distal", "command": "hand other"}
    alike = {"why": "no experiment of the catalogue separates them better than this recording"}
    findings = [
        TIED | {"tie": one},
        FRICTION | {"tie": None},
        TIED | {"joint": "ring_distal", "tie": other},
        TIED | {"joint": None, "tie": alike},
    ]
    which = "leak or pressure gain: this recording cannot distinguish them."
    assert ties(report(findings=findings, next_experiment=one)) == [
        (f"index_distal: {which}", "hand one", "Slow triangle separates leak from pressure gain on index_distal."),
        (f"ring_distal: {which}", "hand other", "Hold separates leak from pressure gain on ring_distal."),
        (f"everywhere: {which}", "", "No experiment of the catalogue separates them better than this recording."),
    ]
    assert ties(report(findings=[FRICTION | {"tie": None}])) == []


def test_the_numbers_are_those_of_the_test_data() -> None:
    """Fails when the errors of training data are shown although test data exist."""
    rows = [
        row("index_distal", 1.0, 0.01, "train"),
        row("index_distal", 2.8, 0.03),
        row("ring_distal", 0.3, 0.3, "train"),
    ]
    content = report(
        findings=[FRICTION], fit=rows, not_judged=[{"joint": "thumb_distal", "reason": "it does not move"}]
    )
    assert tiles(content)[0][0] == "2.8 → 0.03 deg"
    signals, table = heat_map(content)
    assert signals == ["angle"]
    assert [(name, reason) for name, _, reason in table] == [
        ("index_distal", ""),
        ("ring_distal", ""),
        ("thumb_distal", "it does not move"),
    ]
    assert table[0][1][0] is not None and table[0][1][0]["before"] == "280" and table[0][1][0]["after"] == "3"
    assert worst_by_joint(content) == {
        "thumb_distal": None,
        "index_distal": pytest.approx(280.0),
        "ring_distal": pytest.approx(30.0),
    }


def test_joints_that_rest_are_one_row_and_one_tile() -> None:
    """Fails when each of many resting joints takes a row, one is not named, or the tile hides their number."""
    content = report(not_judged=RESTING)
    assert tiles(content)[0] == ("1 of 6", "joints compared with the model")
    last = heat_map(content)[1][-1]
    assert last[0] == "5 others" and last[2].startswith("moved too little: joint_0, ") and "joint_4" in last[2]
    assert [name for name, _, _ in heat_map(report(not_judged=RESTING[:3]))[1]][1:] == ["joint_0", "joint_1", "joint_2"]


def test_the_tint_grows_with_the_error() -> None:
    """Fails when noise is tinted, a larger error is paler, or the tint hides its text."""
    sizes = [tint(ratio) for ratio in (0.5, 1.0, 3.0, 30.0, 100.0, 1e6)]
    assert sizes[0] == sizes[1] == 0.0
    assert sizes == sorted(sizes)
    assert sizes[-1] == SETTINGS.strongest_tint
