"""Detection limits: how small an effect a recording would still have shown."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from hand_diagnosis import Report, diagnose, read_recording
from hand_diagnosis.detection import beginning, detection_limits, limit_table, limits_of
from hand_diagnosis.diagnosis import JointDiagnosis
from hand_diagnosis.problem import validation_rmse
from hand_diagnosis.report import schema
from hand_diagnosis.settings import SETTINGS
from hand_identification.map_fit import map_fit
from hand_model.effects import EFFECTS
from hand_model.effects.effect import OTHER_MACHINES
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from test.diagnosis.recordings import CONFIG, changed, record

SAMPLES = CONFIG.parents[1] / "examples" / "recordings"
JOINT = "index_distal"


@pytest.fixture(scope="module")
def agreeing() -> Report:
    """The sample that is as its description says."""
    recording = read_recording(SAMPLES / "index_plain.csv", CONFIG, mapping=SAMPLES / "map.yaml")
    return diagnose([recording], CONFIG, joints=[JOINT])


@pytest.fixture(scope="module")
def joint(agreeing: Report) -> JointDiagnosis:
    return agreeing.diagnosis.joints[0]


def values(report: Report) -> dict[str, float | None]:
    """Limits by effect."""
    return {row["effect"]: row["value"] for row in report.content["detection_limits"]}


def test_the_report_has_a_limit_of_every_effect(agreeing: Report, tmp_path: Path) -> None:
    """Fails when a limit leaves the schema, an effect is missing, or the page does not show the table."""
    content = agreeing.write(tmp_path)
    jsonschema.validate(content, schema())
    limits = values(agreeing)
    assert limits.keys() == {
        effect.name for effect in EFFECTS.values() if effect.keys and OTHER_MACHINES.isdisjoint(effect.needs)
    }
    assert limits["angle_offset"] is None  # the nominal numbers imitate it
    friction = limits["coulomb_friction"]
    assert friction is not None and 0.0 < friction < 0.012  # what the other sample conceals is found
    page = (tmp_path / "report.html").read_text(encoding="utf-8").replace("<wbr>", "")
    assert "How small an effect this recording would have shown" in page
    assert (
        f"<td>Coulomb friction</td><td>coulomb_friction.torque_nm</td><td>N m</td><td>{float(f'{friction:.2g}'):g}</td>"
        in page
    )


@pytest.mark.parametrize("name", ["coulomb_friction", "gravity", "leak"])
def test_a_fit_leaves_of_an_effect_what_its_limit_says(joint: JointDiagnosis, name: str) -> None:
    """Fails when what the numbers of the model take of an effect is wrong: here they are fitted, not projected.

    The effect at its limit is added to the readings; then the fit leaves an error above the smallest that is claimed.
    """
    problem, final = joint.search.problem, joint.search.final
    (limit,) = limits_of(joint, [EFFECTS[name]])
    assert limit.value is not None
    columns, starts = problem.columns(final.free, final.z[None])
    having = columns.copy()
    for key, value in ((limit.parameter, limit.value), *((key, value) for key, value, _ in limit.others)):
        having[0, ROW[key]] = value * JOINT_PARAMETERS[ROW[key]].scale
    segments = []
    for segment, with_it, plain in zip(
        problem.segments, problem.predict(having, starts), problem.predict(columns, starts), strict=True
    ):
        change = (with_it - plain)[0]
        segments.append(
            replace(segment, pressure_pa=segment.pressure_pa + change[0], angle_rad=segment.angle_rad + change[1])
        )
    refitted = map_fit(replace(problem, segments=segments), final.free, final.z, 6)
    before, after = (validation_rmse(problem, fit.squares) for fit in (final, refitted))
    stage = joint.wording.signals.index(str(limit.signal))
    left = float(np.sqrt(max(after[stage] ** 2 - before[stage] ** 2, 0.0)))
    assert left > 0.8 * float(problem.claimable[stage])


def test_worse_repeatability_gives_larger_limits(joint: JointDiagnosis) -> None:
    """Fails when a limit ignores the repeatability that re-runs measured."""
    problem = joint.search.problem
    rougher = replace(problem, floor=5.0 * problem.floor, weight=problem.weight / 25.0)
    worse = replace(joint, search=replace(joint.search, problem=rougher))
    effects = [EFFECTS[name] for name in ("coulomb_friction", "valve_deadband", "tube_lag")]
    pairs = list(zip(limits_of(joint, effects), limits_of(worse, effects), strict=True))
    for fine, coarse in pairs:
        assert fine.value is not None
        assert coarse.value is None or coarse.value > 2.0 * fine.value, fine.effect


def test_a_long_recording_is_cut(joint: JointDiagnosis, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when the time for limits grows with a recording's length, or a part of it shows more than the whole."""
    problem = joint.search.problem
    half = sum(len(segment.angle_rad) for segment in problem.segments) // 2
    part = beginning(problem, half)
    assert sum(len(segment.angle_rad) for segment in part.segments) == half
    assert part.segments[0].use.shape[1] == half
    effects = [EFFECTS["coulomb_friction"]]
    (whole,) = limits_of(joint, effects)
    monkeypatch.setattr("hand_diagnosis.detection.SETTINGS", replace(SETTINGS, limit_samples=half))
    (fewer,) = limits_of(joint, effects)
    assert whole.value is not None
    assert fewer.value is None or fewer.value >= 0.8 * whole.value


def test_only_agreement_has_limits(agreeing: Report) -> None:
    """Fails when a report with a mismatch claims what it would have shown."""
    assert detection_limits(replace(agreeing.diagnosis, verdict="explained"), list(EFFECTS.values())) == []


def test_the_table_has_a_column_for_each_joint() -> None:
    """Fails when values of joints are exchanged, or a number of the model is not shown next to its limit."""
    row = {"effect": "added_inertia", "parameter": "j", "unit": "kg", "nominal": 0.0, "value": 0.25, "joint": "a"}
    known = row | {"nominal": 2.0, "value": 2.5, "joint": "b"}
    hidden = row | {"value": None, "joint": "c"}
    joints, rows = limit_table([row, known, hidden])
    assert joints == ["a", "b", "c"]
    assert rows == [["added inertia", "j", "kg", "0.25", "2 → 2.5", "not shown"]]


@pytest.mark.long
@pytest.mark.parametrize("name", ["coulomb_friction", "leak", "backlash"])
def test_twice_a_limit_is_found_and_half_of_it_is_not(agreeing: Report, name: str) -> None:
    """Fails when limits are no limits: a larger effect is missed, or a smaller one is claimed."""
    hand, seed = agreeing.hand, 31
    base = diagnose([record(hand, np.random.default_rng(seed), 20.0)], hand, joints=[JOINT], sensor_curve=False)
    (limit,) = limits_of(base.diagnosis.joints[0], [EFFECTS[name]])
    assert limit.value is not None
    found = {}
    for share in (0.5, 2.0):
        size = share * limit.value * JOINT_PARAMETERS[ROW[limit.parameter]].scale
        truth = changed(hand, JOINT, **{limit.parameter.replace(".", "__"): size})
        signals = record(truth, np.random.default_rng(seed + 1), 20.0)
        content = diagnose([signals], hand, joints=[JOINT], sensor_curve=False).content
        found[share] = json.dumps([[f["effect"], *f["tied_with"]] for f in content["findings"]])
    assert name in found[2.0] and found[0.5] == "[]", found
