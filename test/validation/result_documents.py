"""Results of trials and injected faults as their commands give them, for the tests of pages."""

from __future__ import annotations

from typing import Any

from validation.results import load
from validation.trial.score import LABELS

MADE = {"command": "the command", "date": "2026-01-02", "commit": "abc1234", "machine": "2 cores"}


def faults() -> dict[str, Any]:
    """The stored campaign, with one fault that is not handled."""
    stored = load()["faults"]["results"]
    good = [fault for fault in stored if fault["passed"]]
    bad = good[0] | {"hazard": "a <bad> fault", "passed": False, "handled": 0, "unhandled": ["case 7"]}
    return {**MADE, "size": "normal", "seed": 5, "faults": [*good, bad]}


def scores() -> dict[str, Any]:
    """Scores as `hand trial score` gives them, with numbers of their own."""
    share = {"value": 0.8, "low": 0.6, "high": 0.9, "count": 20}
    failure = {"kind": "single", "effect": "leak", "called": "creep", "count": 3, "example": 12, "motion": "steps"}
    return {
        "made": MADE,
        "tool": {"version": "0.2.0"},
        "plant": "development",
        "seed": 4,
        "recordings": 30,
        "graded": 28,
        "scores": dict.fromkeys(LABELS, share) | {"false_alarm": {"value": 0.0, "count": 0}},
        "reliability": [{"claimed": 0.6, "right": 0.7, "count": 9.0}, {"claimed": 0.9, "right": 0.8, "count": 4.0}],
        "by_effect": {"leak": {"cases": 5, "first": 2}},
        "by_group": {"family: turning weight": {"place": share, "first": None}},
        "failures": [failure],
    }
