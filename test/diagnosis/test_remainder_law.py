"""Physics that no effect names gets a law: found in recordings of an independent plant, simulated, and written down."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from hand_diagnosis.api import diagnose
from hand_diagnosis.judgement import RemainderLaw, describe, described, learn_remainder
from hand_diagnosis.judgement.confirmation import _leaves_as_little
from hand_diagnosis.problem import Task, fit_part
from hand_identification.joint_data import joint_problem
from hand_identification.map_fit import map_fit
from hand_model.description import Hand, load_hand
from hand_model.effects import EFFECTS
from hand_model.kernel.rows import ROW
from hand_model.quantities import HAND
from hand_tool.cli import app
from validation.other_forms import JOINT, nominal_model, recording

SEED, FLOORS = 31, 12.0
ANGLE = 1


def law_of(hand: Hand, form: str, floors: float = FLOORS) -> RemainderLaw | None:
    """The law of what the plain model leaves of the angle in a recording with one form."""
    print(f"seed {SEED}")
    signals, _ = recording(hand, form, floors, SEED)
    ready = Task(
        signals=[signals],
        model=nominal_model(hand, SEED),
        joints=[JOINT],
        effects=[],
        tolerance=0.05,
        seed=0,
        floors={},
    ).prepare(JOINT)
    problem = fit_part(ready.problem)
    fit = map_fit(problem, ready.free, ready.start)
    return learn_remainder(problem, ready.problem, fit, ANGLE, describe(problem, fit, ANGLE))


def test_teeth_are_found_by_their_pitch(hand: Hand) -> None:
    """Fails when a torque that repeats with the angle gets another pitch, or its law does not carry over."""
    law = law_of(hand, "cogging")
    assert law is not None and law.placed.family == "periodic_in_angle"
    assert 1.0 / law.values()["unnamed_torque.angle_per_rad"] == pytest.approx(2.0 * math.pi / 14.0, rel=0.01)
    assert law.test is not None and law.test[1] < 0.2 * law.test[0]


def test_a_shaken_base_is_found_by_its_period(hand: Hand) -> None:
    """Fails when a torque that repeats in time gets another period, or its phase is lost beyond the fitted data."""
    law = law_of(hand, "shaken")
    assert law is not None and law.placed.family == "periodic_in_time"
    assert law.values()["unnamed_torque.time_per_s"] == pytest.approx(1.7, rel=0.01)
    assert law.test is not None and law.test[1] < 0.2 * law.test[0]


def test_a_curve_over_the_angle_is_the_missing_torque(hand: Hand) -> None:
    """Fails when the curve is not that of an obstacle at 45 degrees: nearly flat before it, a push back behind.

    A constant torque is also a change of a0, so that only differences count.
    """
    law = law_of(hand, "hertz_obstacle", 60.0)
    assert law is not None and law.placed.family == "depends_on_angle"
    points = described(law, HAND).points
    early, late = points[points[:, 0] < math.radians(35.0), 1], points[points[:, 0] > math.radians(65.0), 1]
    assert late.max() - early.mean() < -4.0 * np.ptp(early)
    assert law.test is not None and law.test[1] < 0.5 * law.test[0]


def test_noise_gets_no_law(hand: Hand) -> None:
    """Fails when a law is confirmed for a plant that has nothing but the plain physics."""
    assert law_of(hand, "plain") is None


def test_the_law_is_reported_written_and_drafted(hand: Hand, tmp_path: Path) -> None:
    """Fails when the report, model.yaml and the draft of an effect do not hold the law, or it does not simulate."""
    others = [name for name, effect in EFFECTS.items() if effect.keys and name != "viscous_friction"]
    signals, _ = recording(hand, "cogging", FLOORS, SEED)
    report = diagnose([signals], nominal_model(hand, SEED), joints=[JOINT], without=others, sensor_curve=False)
    report.write(tmp_path, page=False)
    (left,) = report.remainder
    assert report.verdict == "unknown_physics" and left["family"] == "periodic_in_angle"
    assert "repeats every 0.4" in left["statement"] and " rad of the angle" in left["statement"]
    before, after = left["law"]["errors_si"]["test"]
    assert after < 0.2 * before
    model = load_hand(tmp_path / "model.yaml")
    column = model.joints.index(JOINT)
    pitch = 1.0 / model.parameters[ROW["unnamed_torque.angle_per_rad"], column]
    assert pitch == pytest.approx(2.0 * math.pi / 14.0, rel=0.01)
    again = diagnose([signals], model, joints=[JOINT], without=others, sensor_curve=False)
    assert again.verdict == "agrees", again.remainder
    _check_draft(tmp_path, left["law"]["points"], pitch)


def test_what_repeats_over_the_angle_is_no_stiffening(hand: Hand) -> None:
    """Fails when teeth get the name of a law that has a coefficient at every few degrees, or their pitch is lost."""
    others = [name for name, effect in EFFECTS.items() if effect.keys and name != "stiffening"]
    signals, _ = recording(hand, "coarse_teeth", 60.0, SEED)
    report = diagnose([signals], nominal_model(hand, SEED), joints=[JOINT], without=others, sensor_curve=False)
    (withdrawn,) = report.content["withdrawn"]
    assert withdrawn["effect"] == "stiffening" and "repeats every 51" in withdrawn["reason"]
    (left,) = report.remainder
    assert not report.findings and left["family"] == "periodic_in_angle"
    before, after = left["law"]["errors_si"]["test"]
    assert after < 0.1 * before


def _check_draft(folder: Path, points: list[list[float]], pitch: float) -> None:
    """The draft of an effect is the law of the report."""
    root = Path(__file__).resolve().parents[2]
    for name in ("hand_model/effects/__init__.py", "hand_model/effects/template.py.txt",
                 "hand_model/effects/template_law.py.txt", "test/model/test_effects.py"):  # fmt: skip
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text((root / name).read_text(encoding="utf-8"), encoding="utf-8")
    words = ["new-effect", "gear_ripple", "--from", str(folder / "report.json"), "--tree", str(folder)]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    scope: dict[str, Any] = {}
    exec((folder / "hand_model/effects/gear_ripple.py").read_text(encoding="utf-8"), scope)
    drafted = scope["torque"]
    drafted = getattr(drafted, "py_func", drafted)
    largest = max(abs(law) for _, law, *_ in points)  # points have four digits, so a zero of the law is not exact
    for state, law, *_ in points:
        torque, stiffness = drafted((1.0,), state, 0.0, 0.0, 0.0, (0.0,) * 7)
        assert torque == pytest.approx(law, rel=0.01, abs=1e-3 * largest)
        step = drafted((1.0,), state + 1e-4 * pitch, 0.0, 0.0, 0.0, (0.0,) * 7)[0] - torque
        assert stiffness == pytest.approx(-step / (1e-4 * pitch), rel=0.05, abs=1e-4)


@pytest.mark.parametrize(
    ("content", "part"),
    [
        ("{}", "which is no report.json of hand diagnose"),
        (json.dumps({"remainder": []}), "no remainder of a joint has a law; joints with one: none"),
        (json.dumps({"remainder": [{"joint": "a", "law": None}]}), "joints with one: none"),
    ],
)
def test_a_draft_needs_a_law(tmp_path: Path, content: str, part: str) -> None:
    """Fails when a report without a law gives a traceback or an empty effect."""
    report = tmp_path / "report.json"
    report.write_text(content, encoding="utf-8")
    result = CliRunner().invoke(app, ["new-effect", "x", "--from", str(report)])
    lines = result.output.strip().splitlines()
    assert result.exit_code == 2 and len(lines) == 1
    assert part.replace(" of a joint", "") in lines[0].replace("\n", ""), lines


def test_a_curve_is_drafted_as_its_points(tmp_path: Path) -> None:
    """Fails when the drafted spline leaves the points, or its stiffness is not its slope."""
    rng = np.random.default_rng(SEED)
    points = [[0.1 * k, float(y), 0.0, 0.0, 0.0] for k, y in enumerate(rng.normal(size=25))]
    law = {"effect": "unnamed_torque", "unit": "N m", "over_unit": "rad", "points": points, "statement": "so"}
    row = {"joint": "a", "place": "joint", "family": "depends_on_angle", "law": law}
    (tmp_path / "report.json").write_text(json.dumps({"remainder": [row]}), encoding="utf-8")
    from hand_tool.effect_draft import drafted  # noqa: PLC0415 - only here

    source = drafted(tmp_path / "report.json", "")["EQUATION"]
    scope: dict[str, Any] = {}
    code = "from hand_model.effects.operators import knot\nknot = getattr(knot, 'py_func', knot)\n"
    exec(f"{code}def law(share, phi):\n{source}\n", scope)
    knots = np.array(points)[::3]
    for phi in (-0.2, 0.15, 0.31, 1.234, 2.2, 2.7):
        value, stiffness = scope["law"](1.0, phi)
        assert value == pytest.approx(float(np.interp(phi, knots[:, 0], knots[:, 1])), abs=1e-3)
        slope = scope["law"](1.0, phi + 1e-6)[0] - value
        assert stiffness == pytest.approx(-slope / 1e-6, abs=1e-3)


def test_a_harmonic_that_leaves_more_explains_nothing_more_simply(hand: Hand) -> None:
    """Fails when an effect is withdrawn for a harmonic that leaves several times its error, however simple that is."""
    signals, _ = recording(hand, "cogging", FLOORS, SEED)
    problem = joint_problem([signals], nominal_model(hand, SEED), JOINT)
    fit = map_fit(problem, [], np.zeros(0), 1)
    assert _leaves_as_little(problem, fit, fit)
    assert not _leaves_as_little(problem, replace(fit, squares=9.0 * fit.squares), fit)
