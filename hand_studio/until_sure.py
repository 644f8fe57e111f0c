"""Record until sure: experiments of a running hand, a diagnosis after each, until its causes are certain.

The controller moves the joints, so that all limits and safety functions hold; the shape of an experiment is followed
by the angle instead of the pressure. The diagnosis works on the set-points and readings that were recorded.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Protocol

MOST = 6
"""Recordings after which it ends, however uncertain the answer is."""
READY_S = 15.0
"""Longest wait for the recorder."""
REST_S = 1.0
"""Time at rest at the start of a recording: the diagnosis takes the first state from it."""


class StudyError(Exception):
    """It cannot go on; the message is one line."""


@dataclass(frozen=True, slots=True)
class Motion:
    """An experiment. at: angles [rad] by joint at a time [s] from its begin.  duration_s: its length."""

    name: str
    duration_s: float
    at: Callable[[float], Mapping[str, float]]


@dataclass(frozen=True, slots=True)
class Cause:
    """A cause of a mismatch in words, with its probability, 0 to 1.

    number: its size with error and unit, "" where the recordings do not determine it.
    """

    joint: str
    effect: str
    probability: float
    number: str = ""


@dataclass(frozen=True, slots=True)
class Answer:
    """What a diagnosis says.

    sentence: the title of its report.  certain: whether every cause is.  following: the experiment to record next, ""
    where none is needed or none helps.  folder: of the report.  model: the file of the found model, "" where it is the
    model that the recordings were compared with.
    """

    sentence: str
    causes: tuple[Cause, ...]
    certain: bool
    following: str
    folder: str = ""
    model: str = ""

    def line(self, recordings: int) -> str:
        """The answer as it ends the study, after so many recordings."""
        sure = ("sure " if self.certain else "not sure ") if self.causes else ""
        helpless = "" if self.certain or self.following else ", and no further experiment helps"
        report = f"; report in {self.folder}" if self.folder else ""
        return f"{self.sentence}; {sure}after {_count(recordings)}{helpless}{report}"


class Study(Protocol):
    """Experiments and their diagnosis."""

    def motion(self, name: str, joints: Sequence[str]) -> Motion:
        """An experiment by its name, "" for the first one. StudyError where it does not exist."""

    def diagnose(self, recordings: Sequence[str], joints: Sequence[str]) -> None:
        """Begin to diagnose all recordings together."""

    def answer(self) -> Answer | None:
        """The answer; None while the diagnosis runs. StudyError where it failed."""

    def cancel(self) -> None:
        """End a diagnosis that runs."""


class Robot(Protocol):
    """What a study needs of the hand and of the page."""

    def stay(self, seconds: float) -> None:
        """Show the hand for some time [s]; raises where something else is asked for."""

    def command(self, angles: Mapping[str, float]) -> None:
        """Move joints to angles [rad]."""

    def hold(self, joints: Sequence[str]) -> None:
        """End all motion."""

    def refusal(self) -> str:
        """Why the hand does not move, "" where it does."""

    def record(self) -> str:
        """Begin a recording and return its path."""

    def is_recorded(self) -> bool:
        """Whether the recorder listens."""

    def end_recording(self) -> str:
        """End it and return a line, which begins with `recorded` where there is one."""

    def report(self, note: str, answer: Answer | None) -> None:
        """Show what is done now, and the newest answer."""


def record_until_sure(robot: Robot, study: Study, joints: Sequence[str], period_s: float) -> str:
    """Record and diagnose until the answer is certain; the line about it. StudyError where it cannot go on.

    joints: those that move and are diagnosed.  period_s: of the commands [s].
    """
    recordings: list[str] = []
    names: list[str] = []
    answer: Answer | None = None
    motion = study.motion("", joints)
    try:
        while True:
            recordings.append(_record(robot, motion, len(recordings) + 1, answer, period_s))
            names.append(motion.name)
            study.diagnose(recordings, joints)
            begun = time.monotonic()
            while (found := study.answer()) is None:
                robot.report(f"diagnosing {_count(len(recordings))}, {time.monotonic() - begun:.0f} s", answer)
                robot.stay(period_s)
            answer = found
            robot.report("", answer)
            if not answer.following or len(recordings) >= MOST or names[-2:] == [answer.following] * 2:
                return answer.line(len(recordings))
            motion = study.motion(answer.following, joints)
    finally:
        study.cancel()


def _record(robot: Robot, motion: Motion, number: int, answer: Answer | None, period_s: float) -> str:
    """Record an experiment; the path. StudyError where the hand stops or nothing is recorded."""
    _check(robot)
    path = robot.record()
    done = ""
    joints = list(motion.at(0.0))
    try:
        waited = time.monotonic()
        while not robot.is_recorded():
            robot.report(f"{number}: the recorder starts", answer)
            robot.stay(period_s)
            if time.monotonic() - waited > READY_S:
                raise StudyError(f"the recorder did not start within {READY_S:g} s")
        begun = time.monotonic()
        while (now := time.monotonic() - begun) < REST_S + motion.duration_s:
            _check(robot)
            if now >= REST_S:
                robot.command(motion.at(now - REST_S))
            robot.report(f"{number}: {motion.name}, {now:.0f} of {REST_S + motion.duration_s:.0f} s", answer)
            robot.stay(period_s)
    finally:
        robot.hold(joints)
        done = robot.end_recording()
    if not done.startswith("recorded"):
        raise StudyError(done)
    return path


def _check(robot: Robot) -> None:
    refusal = robot.refusal()
    if refusal:
        raise StudyError(refusal)


def _count(recordings: int) -> str:
    return f"{recordings} recording{'s' * (recordings > 1)}"


def table(note: str, answer: Answer | None) -> str:
    """HTML of what is done now, and of the newest answer: its sentence, its causes and where its report is."""
    shown = _answered(answer) if answer else ""
    return f'<div style="padding:0.4em 0.8em;overflow-wrap:anywhere"><div id="sure">{escape(note)}</div>{shown}</div>'


def _answered(answer: Answer) -> str:
    report = f'<div id="report">Report: {escape(answer.folder)}</div>' if answer.folder else ""
    rows = "".join(map(_row, answer.causes))
    body = f'<table style="width:100%;font-size:0.85em">{rows}</table>' if rows else ""
    return f'<div id="answer" style="font-weight:600">{escape(answer.sentence)}</div>{body}{report}'


def _row(cause: Cause) -> str:
    """A cause with its size below its name, and its probability as a bar and a number."""
    size = f"<br>{escape(cause.number)}" if cause.number else ""
    return (
        f'<tr><td>{escape(cause.effect)}{size}</td><td>{escape(cause.joint)}</td><td style="width:30%">'
        f'<div style="background:#0072b2;height:0.8em;width:{100.0 * cause.probability:.0f}%"></div></td>'
        f'<td style="text-align:right">{cause.probability:.0%}</td></tr>'
    )
