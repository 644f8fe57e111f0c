"""The experiments of Record until sure, and `hand diagnose` in a process of its own after each."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hand_identification.excitation import EXPERIMENTS
from hand_model.description import Hand
from hand_studio.until_sure import Answer, Cause, Motion, StudyError
from hand_tool.studio_replay import MODEL

FIRST = "slow_triangle"
DURATION_S, PERIOD_S = 20.0, 0.02
INSIDE = 0.1
"""Share of a joint's range that stays free at either end: the stops are not what is looked for."""
SURE = 0.9
"""Probability from which a cause is certain."""
STOP_S = 5.0


class Experiments:
    """A study of one hand. Recordings of one call are diagnosed together."""

    def __init__(self, hand: Hand, model: Path, folder: Path) -> None:
        """model: the description that the recordings are compared with.  folder: for the diagnoses."""
        self._hand, self._model, self._folder = hand, model, folder
        self._running: subprocess.Popen[bytes] | None = None
        self._out = folder

    def motion(self, name: str, joints: Sequence[str]) -> Motion:
        """An experiment, FIRST where the name is empty; its level is the share of each joint's range.

        Raises StudyError for an experiment that the page cannot run.
        """
        chosen = name or FIRST
        if chosen not in EXPERIMENTS:
            raise StudyError(f"the next experiment is {chosen}, which the page cannot run")
        time_s = np.arange(0.0, DURATION_S, PERIOD_S)
        angles = {}
        for number, joint in enumerate(joints):
            index = self._hand.joints.index(joint)
            low, high = float(self._hand.limits.low_rad[index]), float(self._hand.limits.high_rad[index])
            level = np.clip(EXPERIMENTS[chosen](time_s, np.random.default_rng(number)), 0.0, 1.0)
            level = np.roll(level, round(0.13 * number * len(level)))
            angles[joint] = low + (INSIDE + (1.0 - 2.0 * INSIDE) * level) * (high - low)

        def at(now_s: float) -> Mapping[str, float]:
            k = min(max(int(now_s / PERIOD_S), 0), len(time_s) - 1)
            return {joint: float(values[k]) for joint, values in angles.items()}

        return Motion(chosen, DURATION_S, at)

    def diagnose(self, recordings: Sequence[str], joints: Sequence[str]) -> None:
        """Start `hand diagnose` with less priority than the nodes of the hand."""
        self._out = self._folder / f"{Path(recordings[-1]).name}_diagnosis"
        self._out.mkdir(parents=True, exist_ok=True)
        options = ["--model", str(self._model), "--joints", ",".join(joints), "--out", str(self._out), "--quiet"]
        command = ["nice", "-n", "10", sys.executable, "-m", "hand_tool", "diagnose", *recordings, *options]
        with (self._out / "diagnose.log").open("wb") as log:
            self._running = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, start_new_session=True)

    def answer(self) -> Answer | None:
        """What report.json says, once the process has ended. Raises StudyError where it failed."""
        if self._running is None or self._running.poll() is None:
            return None
        code, self._running = self._running.returncode, None
        if code != 0:
            lines = (self._out / "diagnose.log").read_text(encoding="utf-8", errors="replace").strip().splitlines()
            raise StudyError(f"the diagnosis failed: {lines[-1] if lines else f'exit code {code}'}")
        answer = answer_of(json.loads((self._out / "report.json").read_text(encoding="utf-8")))
        return replace(answer, folder=str(self._out), model=str(self._out / MODEL) if answer.causes else "")

    def cancel(self) -> None:
        """End a diagnosis that runs."""
        if self._running is not None:
            self._running.terminate()
            try:
                self._running.wait(STOP_S)
            except subprocess.TimeoutExpired:
                self._running.kill()
                self._running.wait()
            self._running = None


def answer_of(report: Mapping[str, Any]) -> Answer:
    """The title and the causes of a report, and whether to go on: until all are certain, or no experiment helps."""
    from hand_diagnosis.pages.headline import title

    causes = [*map(_cause, report["findings"]), *map(_remainder, report["remainder"])]
    left_out = [f"{each['joint']} is left out: {each['reason']}" for each in report["not_judged"]]
    sentence = "; ".join([title(report), *left_out[:1]])
    certain = not report["remainder"] and all(
        found["probability"] >= SURE and not found["tied_with"] for found in report["findings"]
    )
    following = "" if certain else (report["next_experiment"] or {}).get("name", "")
    return Answer(sentence, tuple(causes), certain, following)


def _cause(found: Mapping[str, Any]) -> Cause:
    """A finding; of names that fit equally well, each would have a size of its own."""
    from hand_diagnosis.pages.headline import effect_words, main_number

    names = [effect_words(name) for name in (found["effect"], *found["tied_with"])]
    number = "" if found["tied_with"] else main_number(found)
    return Cause(found["joint"] or "hand", " or ".join(names), found["probability"], number)


def _remainder(left: Mapping[str, Any]) -> Cause:
    number = f"{left['rms']:.2g} {left['unit']} of the {left['signal']}"
    return Cause(left["joint"], "physics that no effect explains", left["probability"], number)
