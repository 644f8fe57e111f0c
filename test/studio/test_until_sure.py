"""Record until sure without a browser: when it ends, what it drives and records, and what it makes of a report."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_identification.excitation import set_points
from hand_model.description import load_hand
from hand_model.kernel.rows import ROW
from hand_recording.replay import record_offline
from hand_studio import until_sure
from hand_studio.until_sure import Answer, Cause, Motion, StudyError, record_until_sure, table
from hand_tool.until_sure import DURATION_S, FIRST, INSIDE, Experiments, answer_of

CONFIG = Path(__file__).parents[2] / "config" / "hand.yaml"
HAND = load_hand(CONFIG)
JOINT = "index_proximal"
UNSURE = Answer(f"{JOINT}: backlash (60%)", (Cause(JOINT, "backlash", 0.6),), False, "reversals")
SURE = Answer(f"{JOINT}: backlash (97%)", (Cause(JOINT, "backlash", 0.97),), True, "", "out/last_diagnosis")


class Ended(Exception):
    """Something else was asked for."""


class FakeRobot:
    """Notes what it is asked to do. ends_at: number of the wait at which something else is asked for."""

    def __init__(self, ends_at: int = 10**9, faults_at: int = 10**9, outcome: str = "recorded: x") -> None:
        self.done: list[str] = []
        self.moved: list[Mapping[str, float]] = []
        self._waits, self._ends_at, self._faults_at, self._outcome = 0, ends_at, faults_at, outcome

    def stay(self, seconds: float) -> None:
        assert seconds > 0.0
        self._waits += 1
        if self._waits >= self._ends_at:
            raise Ended

    def command(self, angles: Mapping[str, float]) -> None:
        self.moved.append(angles)

    def hold(self, joints: Sequence[str]) -> None:
        self.done.append(f"hold {','.join(joints)}")

    def refusal(self) -> str:
        return "vented; press Enable" if self._waits >= self._faults_at else ""

    def record(self) -> str:
        self.done.append("record")
        return f"recording_{self.done.count('record')}"

    def is_recorded(self) -> bool:
        return True

    def end_recording(self) -> str:
        self.done.append("end")
        return self._outcome

    def report(self, note: str, answer: Answer | None) -> None:
        self.done += [note] if answer is SURE else []


class FakeStudy:
    """Gives the answers one after the other."""

    def __init__(self, *answers: Answer) -> None:
        self.answers, self.cancelled = list(answers), False
        self.diagnosed: list[list[str]] = []
        self.names: list[str] = []

    def motion(self, name: str, joints: Sequence[str]) -> Motion:
        self.names.append(name)
        return Motion(name or "first", 0.02, lambda _: dict.fromkeys(joints, 0.1))

    def diagnose(self, recordings: Sequence[str], joints: Sequence[str]) -> None:
        assert list(joints) == [JOINT]
        self.diagnosed.append(list(recordings))

    def answer(self) -> Answer | None:
        return self.answers.pop(0)

    def cancel(self) -> None:
        self.cancelled = True


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(until_sure, "REST_S", 0.001)


def test_it_goes_on_until_the_answer_is_certain() -> None:
    """Fails when it ends too early or too late, takes another experiment, or forgets an earlier recording."""
    robot, study = FakeRobot(), FakeStudy(UNSURE, UNSURE, SURE)
    line = f"{SURE.sentence}; sure after 3 recordings; report in out/last_diagnosis"
    assert record_until_sure(robot, study, [JOINT], 0.001) == line
    assert study.names == ["", "reversals", "reversals"]
    assert study.diagnosed == [[f"recording_{k}" for k in range(1, n + 1)] for n in (1, 2, 3)]
    assert robot.moved and all(angles == {JOINT: 0.1} for angles in robot.moved)
    assert robot.done.count("record") == robot.done.count("end") == 3 and study.cancelled


def test_it_ends_where_nothing_new_is_proposed() -> None:
    """Fails when it repeats an experiment that did not help for ever."""
    study = FakeStudy(*[UNSURE] * 20)
    line = record_until_sure(FakeRobot(), study, [JOINT], 0.001)
    assert line == f"{UNSURE.sentence}; not sure after 3 recordings"


def test_the_line_says_how_certain_the_answer_is() -> None:
    """Fails when an agreement counts as a certain cause, or a study without a next experiment seems to be certain."""
    assert Answer("hand and model agree", (), True, "").line(1) == "hand and model agree; after 1 recording"
    helpless = replace(UNSURE, following="")
    assert helpless.line(2) == f"{UNSURE.sentence}; not sure after 2 recordings, and no further experiment helps"


def test_another_request_ends_it_at_once() -> None:
    """Fails when joints go on moving, the recorder stays open, or a diagnosis goes on after another request."""
    robot, study = FakeRobot(ends_at=2), FakeStudy(SURE)
    with pytest.raises(Ended):
        record_until_sure(robot, study, [JOINT], 0.001)
    assert robot.done == ["record", f"hold {JOINT}", "end"]
    assert study.cancelled and study.diagnosed == []


def test_a_hand_that_stops_ends_it() -> None:
    """Fails when it goes on with a vented hand, or does not say why it ends."""
    robot, study = FakeRobot(faults_at=2), FakeStudy(SURE)
    with pytest.raises(StudyError, match="vented; press Enable"):
        record_until_sure(robot, study, [JOINT], 0.001)
    assert robot.done[-1] == "end" and study.diagnosed == []
    with pytest.raises(StudyError, match="vented"):
        record_until_sure(FakeRobot(faults_at=0), study, [JOINT], 0.001)


def test_a_recording_that_fails_is_not_diagnosed() -> None:
    """Fails when a full disk or a recorder that ended passes for a recording."""
    study = FakeStudy(SURE)
    with pytest.raises(StudyError, match="disk is full"):
        record_until_sure(FakeRobot(outcome="not recorded: disk is full"), study, [JOINT], 0.001)
    assert study.diagnosed == []


@pytest.mark.parametrize("name", ["", "reversals", "chirp", "steps"])
def test_experiments_stay_inside_the_ranges(name: str, tmp_path: Path) -> None:
    """Fails when an experiment goes to an end stop, moves a joint that was not asked for, or stands still."""
    motion = Experiments(HAND, CONFIG, tmp_path).motion(name, [JOINT, "thumb_distal"])
    assert motion.name == (name or FIRST)
    angles = [motion.at(t) for t in np.arange(-0.1, motion.duration_s + 0.1, 0.05)]
    for joint in (JOINT, "thumb_distal"):
        index = HAND.joints.index(joint)
        low, high = HAND.limits.low_rad[index], HAND.limits.high_rad[index]
        own = np.array([each[joint] for each in angles])
        margin = (INSIDE - 1e-9) * (high - low)
        assert low + margin <= own.min() and own.max() <= high - margin
        assert np.ptp(own) > 0.4 * (high - low)
    assert all(set(each) == {JOINT, "thumb_distal"} for each in angles)


def test_an_unknown_experiment_is_one_line(tmp_path: Path) -> None:
    """Fails when a proposal that the page cannot run raises something else."""
    with pytest.raises(StudyError, match="run_0"):
        Experiments(HAND, CONFIG, tmp_path).motion("run_0", [JOINT])


def test_a_concealed_friction_is_found_by_the_process(tmp_path: Path) -> None:
    """Fails when the diagnosis gets another recording, model or joint, or causes, report or model do not come back."""
    parameters = HAND.parameters.copy()
    parameters[ROW["coulomb_friction.torque_nm"], HAND.joints.index(JOINT)] = 0.02
    bag = tmp_path / "rubbing.mcap"
    commands = set_points(FIRST, HAND, [JOINT], DURATION_S, 2e5, 3)
    for _ in record_offline(replace(HAND, parameters=parameters), commands, bag, seed=3):
        pass
    study = Experiments(HAND, CONFIG, tmp_path)
    study.diagnose([str(bag)], [JOINT])
    while (answer := study.answer()) is None:
        time.sleep(0.1)
    (cause,) = answer.causes
    assert answer.certain and answer.following == "", answer
    assert (cause.joint, cause.effect) == (JOINT, "Coulomb friction") and cause.probability > 0.9
    number = re.fullmatch(r"(\S+) ± (\S+) N m", cause.number)
    assert number is not None and abs(float(number[1]) - 0.02) < 3.0 * float(number[2]) < 0.002
    assert answer.sentence == f"{JOINT}: Coulomb friction of {cause.number} ({cause.probability:.0%})"
    assert (Path(answer.folder) / "report.html").is_file() and Path(answer.folder).parent == tmp_path
    torque_nm = load_hand(answer.model).row("coulomb_friction.torque_nm")
    assert torque_nm[HAND.joints.index(JOINT)] == pytest.approx(float(number[1]), rel=0.01)


def test_a_diagnosis_that_fails_is_one_line(tmp_path: Path) -> None:
    """Fails when the process of the diagnosis fails in silence, or is waited for for ever."""
    study = Experiments(HAND, CONFIG, tmp_path)
    study.diagnose([str(tmp_path / "nothing")], [JOINT])
    with pytest.raises(StudyError, match=r"the diagnosis failed: .*nothing"):
        while study.answer() is None:
            pass
    study.diagnose([str(tmp_path / "nothing")], [JOINT])
    study.cancel()
    assert study.answer() is None


def finding(probability: float, *tied: str) -> dict[str, object]:
    """A finding of a report."""
    width = {"value": 0.02, "std": 0.001, "unit": "rad", "determined": True}
    others = [{"effect": name, "probability": 0.02} for name in tied]
    own = {"joint": JOINT, "effect": "backlash", "probability": probability, "parameters": {"backlash.width": width}}
    return own | {"tied_with": list(tied), "alternatives": others}


def report(findings: list[dict[str, object]], following: str = "reversals", left: float = 0.0) -> dict[str, object]:
    """A report with what an answer is made of."""
    remainder = [{"joint": JOINT, "signal": "angle", "rms": 0.831, "unit": "deg", "probability": left}] if left else []
    content = {"findings": findings, "remainder": remainder, "fit": [{"joint": JOINT}], "not_judged": []}
    return content | {"next_experiment": {"name": following, "why": ""} if following else None}


def test_an_answer_is_certain_only_where_all_of_it_is() -> None:
    """Fails when a tie, a remainder or an improbable cause counts as certain, or a certain one asks for more."""
    agreed = answer_of(report([]))
    assert (agreed.causes, agreed.certain, agreed.following) == ((), True, "")
    assert agreed.sentence == "Model and recording agree: no effect of the catalogue is missing"
    assert answer_of(report([finding(0.95)])).following == ""
    assert answer_of(report([finding(0.95)])).certain
    for unsure in (report([finding(0.7)]), report([finding(0.95, "hysteresis")]), report([finding(0.95)], left=0.8)):
        assert answer_of(unsure).following == "reversals" and not answer_of(unsure).certain
    assert answer_of(report([finding(0.95)], left=0.8)).causes[-1].probability == 0.8
    assert not answer_of(report([finding(0.6)], following="")).certain


def test_an_answer_has_the_title_of_the_report_and_the_size_of_every_cause() -> None:
    """Fails when the sentence is another one, or a number lacks its error or unit, or belongs to one name of two."""
    answer = answer_of(report([finding(0.95)], left=0.8) | {"not_judged": [{"joint": "thumb", "reason": "it rested"}]})
    assert answer.sentence.startswith(f"{JOINT}: backlash of 0.0200 ± 0.0010 rad (95%); {JOINT}: 0.83 deg of the angle")
    assert answer.sentence.endswith("1 of 2 joints not diagnosed; thumb is left out: it rested")
    assert [cause.number for cause in answer.causes] == ["0.0200 ± 0.0010 rad", "0.83 deg of the angle"]
    assert answer_of(report([finding(0.95, "hysteresis")])).causes[0].number == ""
    shown = table("1: <reversals>", replace(answer, folder="out/<here>"))
    for text in ("&lt;reversals&gt;", answer.sentence, "0.0200 ± 0.0010 rad", "95%", "Report: out/&lt;here&gt;"):
        assert text in shown
    assert "backlash or hysteresis" in table("", answer_of(report([finding(0.95, "hysteresis")])))
