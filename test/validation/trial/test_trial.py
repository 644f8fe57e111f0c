"""The blind trial: an independent plant, sealed truth, strict grading, and the commands as a user calls them."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hand_model.description import load_hand
from hand_sim.plant import PHI, HandPlant, P
from validation.ablations import TEXTBOOK, diagnosed
from validation.results import load, read_run
from validation.tables import proof_table
from validation.trial.calibration import brier, calibration_error, log_score
from validation.trial.catalogue import BY_NAME, FOREIGN, KNOWN
from validation.trial.document import (
    REFEREE_GOALS,
    effects_table,
    failures_table,
    families_table,
    runs_table,
    scores_table,
)
from validation.trial.grade import grade
from validation.trial.limits import REPEATABILITY, Projector, limit_size, rms, scene
from validation.trial.make import draw_cases
from validation.trial.motions import EXPERIMENTS, HIGHEST_PA, set_points
from validation.trial.nominal import Nominal
from validation.trial.plant import record
from validation.trial.run import BATCH, read_plan, run
from validation.trial.score import LABELS, score, scores_of
from validation.trial.seal import NUMBERS, SEALED, new_key, seal, tool_numbers, unseal

ROOT = Path(__file__).parents[3]
CONFIG = ROOT / "config" / "hand.yaml"
FRAME_S = 0.01


def hand(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "hand_tool", *arguments],
        cwd=ROOT, env=os.environ | environment, capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip


def test_both_plants_agree_where_nothing_is_concealed() -> None:
    """Fails when one of two independent plants of the same hand is wrong: they agree within 0.1 degree and 2 kPa."""
    nominal, rng = Nominal(CONFIG), np.random.default_rng(1)
    u = set_points("mixed", 1500, FRAME_S, 11, rng)
    ours = record(nominal.rows, u, FRAME_S, nominal.partner, nominal.neighbour, wander=np.zeros(1500))
    plant = HandPlant(load_hand(CONFIG), FRAME_S)
    states = np.concatenate([plant.state[None], plant.advance(u[:-1])])
    assert np.degrees(np.sqrt(np.mean((states[:, PHI] - ours[1]) ** 2, axis=0))).max() < 0.1
    assert np.abs(states[:, P] - ours[0]).max() < 2e3


def test_limits_are_what_they_say() -> None:
    """Fails when an effect at its detection limit does more or less than the repeatability of its signal."""
    nominal, rng = Nominal(CONFIG), np.random.default_rng(2)
    u = set_points("mixed", 2000, FRAME_S, 11, rng)
    still = np.zeros(2000)
    where = scene(nominal.rows, u, nominal.partner, nominal.neighbour, 3, frame_s=FRAME_S, wander=still)
    for name in ("coulomb_friction", "valve_hysteresis", "gravity"):
        concealed = BY_NAME[name]
        size = limit_size(concealed, where)
        projector = Projector(where, concealed.stage)
        left = projector.remainder(where.readings(concealed, size)[concealed.stage] - projector.plain)
        assert rms(left) == pytest.approx(1.0, abs=0.25), name
    assert len(REPEATABILITY) == 3


@pytest.mark.parametrize("kind", EXPERIMENTS)
def test_ten_minutes_of_every_motion(kind: str) -> None:
    """Fails when a motion runs out of set-points in the longest recordings, or stops to move in them."""
    u = set_points(kind, round(600.0 / FRAME_S), FRAME_S, 2, np.random.default_rng(4))
    assert np.ptp(u[-round(60.0 / FRAME_S) :], axis=0).min() > 0.3 * HIGHEST_PA


def test_the_set_has_the_promised_shares() -> None:
    """Fails when a kind of case, a multiple or an effect is short in the set."""
    cases = draw_cases(404, 7)
    kinds = [case.kind for case in cases]
    assert kinds.count("null") >= 0.2 * 404
    assert kinds.count("pair") >= 0.15 * 404
    assert kinds.count("outside") >= 0.1 * 404
    alone = {(case.effects[0]) for case in cases if case.kind == "single"}
    assert alone == {(known.name, multiple) for known in KNOWN for multiple in (1.0, 2.0, 5.0)}
    assert {case.motion for case in cases} == set(EXPERIMENTS)
    assert not {foreign.name for foreign in FOREIGN} & {known.name for known in KNOWN}


def test_only_the_key_opens_the_truth(tmp_path: Path) -> None:
    """Fails when a wrong key opens the truth, or a truth that was replaced is accepted."""
    key = new_key()
    commitment = seal({"cases": []}, tmp_path, key)
    assert unseal(tmp_path, key)[1] == commitment
    assert b"cases" not in (tmp_path / SEALED).read_bytes()
    with pytest.raises(ValueError, match="the key does not open it"):
        unseal(tmp_path, new_key())
    other = tmp_path / "other"
    other.mkdir()
    seal({"cases": ["exchanged"]}, other, key)
    (tmp_path / SEALED).write_bytes((other / SEALED).read_bytes())
    with pytest.raises(ValueError, match="was promised"):
        unseal(tmp_path, key)


def truth(effect: str, joint: str | None, place: str, **more: Any) -> dict[str, Any]:
    return {"effect": effect, "joint": joint, "place": place, "multiple": 2.0, "group": [effect], "number": None} | more


def finding(effect: str, joint: str | None, place: str, probability: float = 0.9, **more: Any) -> dict[str, Any]:
    base = {"effect": effect, "joint": joint, "place": place, "probability": probability}
    return base | {"alternatives": [], "parameters": {}} | more


def graded(kind: str, truths: list[Any], findings: list[Any], without: str = "", left: str = "") -> Any:
    """left: a joint with a remainder."""
    case = {"number": 1, "kind": kind, "motion": "steps", "without": without, "truth": truths}
    remainder = [{"joint": left, "probability": 0.8}] if left else []
    return grade(case, {"findings": findings, "fit": [], "remainder": remainder})


def test_grading_is_strict() -> None:
    """Fails when a wrong joint, place or effect counts as right, or a member of the group as wrong."""
    friction = truth("coulomb_friction", "index_distal", "joint")
    right = graded("single", [friction], [finding("coulomb_friction", "index_distal", "joint")])
    assert right.first and right.joint and right.place and right.claims == [(0.9, True)]
    elsewhere = graded("single", [friction], [finding("coulomb_friction", "ring_distal", "joint")])
    assert not elsewhere.first and not elsewhere.joint and elsewhere.claims == [(0.9, False)]
    rival = [{"effect": "coulomb_friction"}]
    second = graded("single", [friction], [finding("backlash", "index_distal", "joint", alternatives=rival)])
    assert not second.first and second.first_two
    twins = truth("constant_load", "index_distal", "environment", group=["constant_load", "angle_offset"])
    assert graded("single", [twins], [finding("angle_offset", "index_distal", "angle_sensor")]).first
    assert graded("null", [], [finding("leak", "index_distal", "fluid")]).false_alarm
    assert graded("null", [], []).false_alarm is False
    assert not graded(
        "deleted", [friction], [finding("backlash", "index_distal", "joint")], "coulomb_friction"
    ).unknown_found
    deleted = graded("deleted", [friction], [], "coulomb_friction", left="index_distal")
    assert deleted.unknown_found and deleted.claims == [(0.8, True)] and deleted.called == "unknown"
    assert not graded("deleted", [friction], [], "coulomb_friction", left="ring_distal").unknown_found
    assert graded("single", [friction], [], left="index_distal").unknown_wrong
    both = graded("single", [friction], [finding("coulomb_friction", "index_distal", "joint")], left="index_distal")
    assert both.first and not both.unknown_wrong and both.claims == [(0.9, True)]
    assert graded("null", [], [], left="ring_distal").false_alarm
    number = {"key": "coulomb_friction.torque_nm", "value": 0.01}
    reported = {"coulomb_friction.torque_nm": {"value": 0.012, "std": 0.0008}}
    measured = graded(
        "single",
        [friction | {"number": number}],
        [finding("coulomb_friction", "index_distal", "joint", parameters=reported)],
    )
    assert measured.parameters[0][1] == pytest.approx(0.2)
    assert measured.deviations == [("coulomb_friction.torque_nm", pytest.approx(2.5))]
    assert scores_of([measured])["deviations"]["value"] == 0.0


def test_a_remainder_is_graded_by_its_family() -> None:
    """Fails when a wrong family counts as right, or a kind without a family of its own is asked for one."""
    teeth = truth("teeth", "index_distal", "unknown", family="angle")
    for family, right in (("periodic_in_angle", True), ("depends_on_angle", True), ("drifts_with_time", False)):
        case = {"number": 1, "kind": "outside", "motion": "steps", "without": "", "truth": [teeth]}
        left = {"joint": "index_distal", "probability": 0.8, "family": family}
        assert grade(case, {"findings": [], "fit": [], "remainder": [left]}).unknown_family is right
    spikes = truth("spikes", "index_distal", "unknown", family="sensor")
    assert graded("outside", [spikes], [], left="index_distal").unknown_family is None
    assert graded("outside", [teeth], []).unknown_family is None


def test_calibration_error_is_that_of_the_claims() -> None:
    """Fails when probabilities that are higher than the share of right findings count as calibrated."""
    assert calibration_error([(0.9, True)] * 9 + [(0.9, False)]) == pytest.approx(0.0, abs=1e-12)
    assert calibration_error([(0.9, False)] * 10) == pytest.approx(0.9)


def test_the_scores_of_probabilities_are_those_of_the_literature() -> None:
    """Fails when Brier and log score are not those of Brier 1950 and Good 1952, or certainty costs without end."""
    claims = [(0.8, True), (0.6, False), (1.0, True), (1.0, False)]
    assert brier(claims) == pytest.approx((0.04 + 0.36 + 0.0 + 1.0) / 4.0)
    expected = (math.log(0.8) + math.log(0.4) + math.log(0.999) + math.log(0.001)) / 4.0
    assert log_score(claims) == pytest.approx(expected)
    assert brier([]) is None and log_score([]) is None


def test_reports_of_other_settings_than_sealed_are_refused(tmp_path: Path) -> None:
    """Fails when the tool's version or a number of it may change between the seal and the diagnosis."""
    numbers = {name: {"block_s": 1.0} for name in NUMBERS}
    case = {"number": 0, "kind": "null", "truth": [], "without": "", "motion": "steps", "unplaced": []}
    key = new_key()
    seal({"seed": 1, "tool": tool_numbers("1.0", numbers), "cases": [case]}, tmp_path, key)
    (tmp_path / "timing.json").write_text('{"seconds": 1.0, "jobs": 1}', encoding="utf-8")
    place = tmp_path / "reports" / "0" / "case_0000_0a1b2c3d" / "report.json"
    place.parent.mkdir(parents=True)
    report = {**numbers, "made": {"version": "1.0"}, "findings": [], "remainder": []}
    changes: list[dict[str, Any]] = [{"made": {"version": "1.1"}}, *({name: {"block_s": 2.0}} for name in NUMBERS)]
    for changed in changes:
        place.write_text(json.dumps(report | changed), encoding="utf-8")
        with pytest.raises(ValueError, match="another version or other settings"):
            score(tmp_path, key)
    place.write_text(json.dumps(report), encoding="utf-8")
    assert score(tmp_path, key)["tool"] == tool_numbers("1.0", numbers)


def test_missing_frames_are_graded_by_what_the_recorder_lost() -> None:
    """Fails when a right statement on lost frames is a false alarm, or a wrong one, on a whole recording, is none."""
    case = {"number": 1, "kind": "null", "truth": [], "without": "", "motion": "steps", "conditions": {"lost": 0.03}}
    finding = {"joint": None, "place": "timing", "effect": "dropped_frames", "probability": 0.99}
    report = {"findings": [finding], "remainder": []}
    assert grade(case, report).false_alarm is False
    assert grade(case | {"conditions": {"lost": 0.0}}, report).false_alarm is True
    assert grade({key: case[key] for key in case if key != "conditions"}, report).false_alarm is True


def test_the_tables_say_what_the_scores_say() -> None:
    """Fails when a goal that is not reached, or an example of a failure, is missing in the tables of the page."""
    share = {"value": 0.5, "low": 0.2, "high": 0.8, "count": 4}
    result = {
        "seed": 1, "commitment": "c", "recordings": 4, "graded": 4, "kinds": {"null": 4}, "unplaced": {},
        "timing": {"seconds": 60.0, "jobs": 2}, "scores": {"place": share}, "at_the_limit": {"place": share},
        "failures": [
            {"kind": "null", "effect": "nothing", "called": "leak", "count": 1, "example": 3, "motion": "steps"}
        ],
    }  # fmt: skip
    assert "**not reached**" in scores_table(result)
    assert "case 3, steps" in failures_table(result)


def test_runs_against_plants_of_others_are_added_and_never_replaced(tmp_path: Path) -> None:
    """Fails when a run replaces an earlier one, is stored twice or as one of the own plant, or loses a score."""
    share = {"value": 0.25, "low": 0.1, "high": 0.6, "count": 4}
    scores = {name: dict(share) for name in LABELS} | {"ece": {"value": 0.1, "count": 4}}
    made = {"command": "hand trial score OUT", "date": "2026-01-02", "commit": "abcdef0"}
    run = {
        "plant": "held_back", "commitment": "c0ffee", "seed": 5, "recordings": 4, "kinds": {"single": 4},
        "made": made, "scores": scores, "timing": None, "reliability": [],
        "by_group": {"family: a stack": {"joint": share, "first": share, "clean": share}},
    }  # fmt: skip
    (tmp_path / "scores.json").write_text(json.dumps(run), encoding="utf-8")
    before = load().get("referees", {}).get("results", [])
    found = read_run(tmp_path)["referees"]["results"]
    assert found[:-1] == before and found[-1]["scores"] == scores and "timing" not in found[-1]
    assert found[-1]["made"] == made | {"command": "hand trial make OUT --plant held_back"}
    table = runs_table(found)
    assert (
        "held_back, 2026-01-02: commit abcdef0, master seed 5, commitment `c0ffee`, 4 recordings (4 single)." in table
    )
    assert all(f"| {LABELS[name]} |" in table for name in REFEREE_GOALS)
    assert "| held_back | 2026-01-02 | abcdef0 | 25 % (10 to 60) of 4 |" in table
    assert "| held_back | a stack | 4 | 1 of 4 | 1 of 4 | 1 of 4 |" in families_table(found)
    if before:
        (tmp_path / "scores.json").write_text(
            json.dumps(run | {"commitment": before[0]["commitment"]}), encoding="utf-8"
        )
        with pytest.raises(ValueError, match="is stored already"):
            read_run(tmp_path)


def test_recordings_are_diagnosed_side_by_side_the_largest_first(tmp_path: Path) -> None:
    """Fails when a recording is left out or diagnosed with another model, or a large one comes last and all wait."""
    (tmp_path / "recordings").mkdir()
    models = ["model.yaml"] * (BATCH + 1) + ["machine.yaml"]
    plan = [{"number": k, "model": model, "without": "", "tolerance": 0.0} for k, model in enumerate(models)]
    (tmp_path / "plan.json").write_text(json.dumps(plan), encoding="utf-8")
    for number, model in enumerate(models):
        kind = "npz" if model == "machine.yaml" else "mcap"
        (tmp_path / "recordings" / f"case_{number:04d}.{kind}").write_bytes(b"x" * (1 + number))
    tool = tmp_path / "tool.py"
    tool.write_text(
        "import sys\nfrom pathlib import Path\n"
        "with Path(__file__).with_suffix('.log').open('a') as log: log.write(' '.join(sys.argv[2:]) + '\\n')\n"
    )
    shares: list[float] = []
    run(tmp_path, [sys.executable, str(tool)], 1, 0.05, shares.append)
    calls = [line.split() for line in tool.with_suffix(".log").read_text(encoding="utf-8").splitlines()]
    named = [[Path(word).stem for word in call if "case_" in Path(word).name] for call in calls]
    assert named == [["case_0007"], [f"case_{k:04d}" for k in range(BATCH, 0, -1)], ["case_0000"]]
    assert ["--machine" in call for call in calls] == ["--no-sensor-curve" not in call for call in calls]
    assert shares[-1] == 1.0


def test_a_diagnosis_that_fails_ends_the_trial_and_the_others(tmp_path: Path) -> None:
    """Fails when a trial goes on without a recording, names no reason, or leaves a process behind."""
    (tmp_path / "recordings").mkdir()
    plan = [{"number": k, "model": f"model_{k}.yaml", "without": "", "tolerance": 0.0} for k in range(2)]
    (tmp_path / "plan.json").write_text(json.dumps(plan), encoding="utf-8")
    tool = tmp_path / "tool.py"
    tool.write_text(
        "import os, sys, time\nfrom pathlib import Path\n"
        "pid = Path(__file__).with_suffix('.pid')\n"
        "if 'model_0' in ' '.join(sys.argv):\n"
        "    part = pid.with_suffix('.part')\n    part.write_text(str(os.getpid()))\n    part.rename(pid)\n"
        "    time.sleep(600)  # a long diagnosis, which must be ended\n"
        "for _ in range(3000):  # the other one fails while that one runs, or after half a minute\n"
        "    if pid.exists(): break\n"
        "    time.sleep(0.01)\n"
        "sys.exit('broken recording')\n"
    )
    with pytest.raises(RuntimeError, match="ended with 1: broken recording"):
        run(tmp_path, [sys.executable, str(tool)], 2, 0.05, lambda _: None)
    with pytest.raises(ProcessLookupError):
        os.kill(int(tool.with_suffix(".pid").read_text(encoding="utf-8")), 0)


def test_a_small_trial_from_end_to_end(tmp_path: Path) -> None:
    """Fails when the proof, its make, run and score do not fit together, when a diagnosis starts although the key is
    set, or when a part that is switched off still acts.
    """
    out = tmp_path / "proof"
    proved = subprocess.run(
        [sys.executable, "-m", "validation.proof", "--cases", "5", "--plant", "trial", "--out", str(out)],
        cwd=ROOT, capture_output=True, text=True, timeout=900, check=False,
    )  # fmt: skip
    assert proved.returncode == 0, proved.stderr
    assert "joint correct" in proved.stdout and "<html" in (out / "proof.html").read_text(encoding="utf-8").lower()
    stored = read_run(out / "proof.json")["proof"]
    assert stored["results"]["plants"]["trial"]["recordings"] == 5 and "Made by `make proof`" in proof_table(stored)
    folder = out / "trial"
    plan = (folder / "plan.json").read_text(encoding="utf-8")
    assert not any(foreign.name in plan.replace('"without"', "") for foreign in FOREIGN)
    refused = hand("trial", "run", str(folder), HAND_TRIAL_KEY=new_key().decode())
    assert refused.returncode == 2 and "must not be able to open the seal" in refused.stderr
    result = json.loads((folder / "scores.json").read_text(encoding="utf-8"))
    print(result["seed"], result["scores"])
    page = (ROOT / "docs" / "proof.md").read_text(encoding="utf-8")
    for render in (scores_table, effects_table, failures_table):
        header = next(line for line in render(result).splitlines() if line.startswith("|"))
        assert header in page
    assert read_run(folder)["trial"]["results"] == result
    assert (folder / "commitment.txt").read_text(encoding="ascii").strip() == result["commitment"]
    assert result["recordings"] == 5
    assert result["scores"]["joint"]["value"] >= 0.5
    assert (folder / "confusion.png").stat().st_size > 5000
    wrong = hand("trial", "score", str(folder), "--key", new_key().decode())
    assert wrong.returncode == 2 and "does not open it" in wrong.stderr
    found, seconds = diagnosed(str(folder), read_plan(folder)[0], TEXTBOOK)
    assert seconds > 0.0 and not any((finding["law"] or {}).get("form") == "learned" for finding in found["findings"])


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("make", "nowhere", "--cases", "3"), "--cases is 3; the allowed range is 5 to 100000"),
        (("make", "nowhere", "--jobs", "0"), "--jobs is 0; the allowed range is 1 to 256"),
        (("make", "nowhere", "--plant", "dev"), "--plant is 'dev'; it must be one of trial, development, held_back"),
        (("export", "nowhere", "x"), "nowhere holds no trial (plan.json is missing)"),
        (("run", "nowhere"), "nowhere holds no trial (plan.json is missing)"),
        (("reality", "nowhere", "--out", "x"), "nowhere: neither pneumatic_cylinder nor servo_pendulum"),
    ],
)
def test_bad_usage_is_one_line(arguments: tuple[str, ...], line: str) -> None:
    """Fails when bad usage ends in a traceback, several lines, or another exit code than 2."""
    done = hand("trial", *arguments)
    assert done.returncode == 2
    assert line in done.stderr and len(done.stderr.strip().splitlines()) == 1


CASE = {"number": 0, "model": "m.yaml", "without": "", "tolerance": 0.0}
BROKEN = {
    "no JSON": "{",
    "deep": "[" * 100_000,
    "a mapping": "{}",
    "no case": "[]",
    "a number": "[3]",
    "a missing key": json.dumps([{"number": 0, "model": "m.yaml"}]),
    "another key": json.dumps([CASE | {"stray": 1}]),
    "text for a number": json.dumps([CASE | {"number": "0"}]),
    "truth for a number": json.dumps([CASE | {"number": True}]),
    "a list for the model": json.dumps([CASE | {"model": ["m.yaml"]}]),
    "twice": json.dumps([CASE, CASE]),
    "negative": json.dumps([CASE | {"number": -1}]),
    "outside": json.dumps([CASE | {"model": "../m.yaml"}]),
}


@pytest.mark.parametrize("text", BROKEN.values(), ids=BROKEN)
def test_a_broken_plan_is_one_line(text: str, tmp_path: Path) -> None:
    """Fails when a plan.json that was edited or cut off ends in another exception or in several lines."""
    (tmp_path / "plan.json").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=r"plan\.json") as caught:
        read_plan(tmp_path)
    assert "\n" not in str(caught.value)


def test_the_command_names_a_broken_plan(tmp_path: Path) -> None:
    """Fails when `hand trial run` shows a traceback for a plan without numbers, or diagnoses anything."""
    case = {"model": "m.yaml", "without": "", "tolerance": 0.0}
    (tmp_path / "plan.json").write_text(json.dumps([case]), encoding="utf-8")
    done = hand("trial", "run", str(tmp_path))
    assert done.returncode == 2
    assert (
        done.stderr.strip().splitlines()[-1].endswith("case 0 must be a mapping of number, model, without, tolerance")
    )
    assert "Traceback" not in done.stderr and not (tmp_path / "reports").exists()
