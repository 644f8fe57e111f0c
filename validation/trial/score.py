"""The scores of a trial: shares with confidence intervals, calibration, confusion matrix, and their pictures."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from validation.trial.calibration import brier, calibration_error, log_score, reliability
from validation.trial.grade import STANDARD_ERRORS, WITHIN, Grade, grade
from validation.trial.seal import tool_numbers, unseal

mpl.use("Agg")
import matplotlib.pyplot as plt

GOALS = {
    "place": (">=", 0.97), "joint": (">=", 0.98), "first": (">=", 0.90), "first_two": (">=", 0.97),
    "both": None, "false_alarm": ("<=", 0.02), "unknown_found": (">=", 0.80), "unknown_wrong": ("<=", 0.05),
    "unknown_family": None, "clean": (">=", 0.90), "parameters": (">=", 0.85), "deviations": None, "onset": None,
    "ece": ("<=", 0.06), "brier": None, "log_score": None,
}  # fmt: skip
LABELS = {
    "place": "place correct",
    "joint": "joint correct",
    "first": "effect named first (one hidden)",
    "first_two": "effect among the first two",
    "both": "both of two effects named",
    "false_alarm": "false alarms on null cases",
    "unknown_found": "unknown physics reported as unknown",
    "unknown_family": "family of the unknown physics named",
    "unknown_wrong": "known effects reported as unknown",
    "clean": "error at most 1.25 noise floors, data not fitted",
    "parameters": "parameters within 15 % (where both forms have them)",
    "deviations": "parameters within 2 of their standard errors",
    "onset": "beginning found within 0.5 s",
    "ece": "expected calibration error",
    "brier": "Brier score of the claims (0 is best)",
    "log_score": "log score of the claims (0 is best)",
}
"""What each score counts, in the words of docs/proof.md."""
GRADED_FROM = 2.0
OF_ALL = {"parameters", "deviations", "ece", "brier", "log_score"}
"""Scores over all numbers or claims, not one a case."""


def score(
    folder: Path, key: bytes, answers: dict[int, dict[str, Any]] | None = None, made: dict[str, str] | None = None
) -> dict[str, Any]:
    """Open the seal, grade every case, write scores.json and the pictures; returns the scores.

    answers: reports by the number of their case; None: those of the trial's folder, with the time that they took.
    made: command, date, commit and machine of the run, kept with the scores.
    ValueError: a wrong key, a broken seal, a missing report, or one of another version or other settings than sealed.
    """
    truth, commitment = unseal(folder, key)
    grades = [_grade(folder, case, answers, truth.get("tool")) for case in truth["cases"]]
    graded = those_graded(grades)
    claims = [claim for g in graded for claim in g.claims]
    result = {
        "commitment": commitment,
        "made": made,
        "tool": truth.get("tool"),
        "plant": plant_of(truth["cases"]),
        "seed": truth["seed"],
        "recordings": len(grades),
        "graded": len(graded),
        "kinds": dict(Counter(g.kind for g in grades)),
        "unplaced": dict(Counter(name for case in truth["cases"] for name in case["unplaced"])),
        "timing": json.loads((folder / "timing.json").read_text(encoding="utf-8")) if answers is None else None,
        "scores": scores_of(grades),
        "at_the_limit": {
            name: _share(name, [g for g in grades if g.kind == "single" and g.multiple < GRADED_FROM])
            for name in ("place", "joint", "first", "first_two")
        },
        "reliability": reliability(claims),
        "by_effect": by_effect(graded),
        "by_group": by_group(graded, truth["cases"]),
        "failures": failures(graded),
    }
    (folder / "scores.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    (folder / "grades.json").write_text(json.dumps([asdict(g) for g in grades], indent=1) + "\n", encoding="utf-8")
    draw_confusion(graded, folder / "confusion.png")
    draw_reliability(result["reliability"], folder / "reliability.png")
    return result


def those_graded(grades: Iterable[Grade]) -> list[Grade]:
    """The null cases, and those of at least GRADED_FROM detection limits."""
    return [g for g in grades if g.kind == "null" or g.multiple >= GRADED_FROM]


def scores_of(grades: Iterable[Grade]) -> dict[str, dict[str, Any]]:
    """Every score of LABELS: value, count and, of shares, the 95 % interval."""
    graded = those_graded(grades)
    scores = {name: _share(name, graded) for name in LABELS if name not in OF_ALL}
    scores["parameters"] = _interval([error <= WITHIN for g in graded for _, error in g.parameters])
    scores["deviations"] = _interval([error <= STANDARD_ERRORS for g in graded for _, error in g.deviations])
    claims = [claim for g in graded for claim in g.claims]
    for name, of in (("ece", calibration_error), ("brier", brier), ("log_score", log_score)):
        scores[name] = {"value": of(claims), "count": len(claims)}
    return scores


def plant_of(cases: list[dict[str, Any]]) -> str:
    """Who concealed the effects: trial, development, held_back or mujoco."""
    referee = str(cases[0].get("referee", "trial"))
    return str(cases[0]["half"]) if referee == "families" else referee


def _grade(
    folder: Path, case: dict[str, Any], answers: dict[int, dict[str, Any]] | None, tool: dict[str, Any] | None
) -> Grade:
    if answers is not None:
        if case["number"] not in answers:
            raise ValueError(f"case {case['number']} has no answer")
        return grade(case, answers[case["number"]])
    found = sorted(folder.glob(f"reports/*/case_{case['number']:04d}_*/report.json"))
    if not found:
        raise ValueError(f"{folder}: case {case['number']} has no report; run the trial first")
    report = json.loads(found[0].read_text(encoding="utf-8"))
    # A report of many at once does not say by which version it was made; its settings are there all the same.
    if tool is not None and tool_numbers(report.get("made", tool)["version"], report) != tool:
        raise ValueError(f"{found[0]}: made by another version or other settings than those that were sealed before")
    return grade(case, report)


def _share(name: str, grades: Iterable[Grade]) -> dict[str, Any]:
    return _interval([bool(getattr(g, name)) for g in grades if getattr(g, name) is not None])


def _interval(hits: list[bool]) -> dict[str, Any]:
    """A share with its 95 % interval by Wilson's score."""
    n = len(hits)
    if n == 0:
        return {"value": None, "low": None, "high": None, "count": 0}
    p, z = sum(hits) / n, 1.96
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return {"value": p, "low": max(middle - half, 0.0), "high": min(middle + half, 1.0), "count": n}


def by_effect(grades: list[Grade]) -> dict[str, dict[str, int]]:
    """For each effect concealed alone: the number of cases, and in how many it was named first."""
    out: dict[str, dict[str, int]] = {}
    for g in grades:
        if g.kind == "single":
            row = out.setdefault(g.effect, {"cases": 0, "first": 0})
            row["cases"] += 1
            row["first"] += int(bool(g.first))
    return dict(sorted(out.items()))


def by_group(grades: list[Grade], cases: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Scores of the cases with a referee, a family or a condition in common, by its name."""
    groups: dict[str, list[Grade]] = {}
    case_of = {case["number"]: case for case in cases}
    for g in grades:
        case = case_of[g.number]
        names = [f"referee: {case.get('referee', 'trial')}", f"{g.multiple:g} x the limit", f"motion: {g.motion}"]
        names += [f"condition: {label}" for label in case.get("labels", [])]
        names += [f"family: {name}" for name in case.get("families", [])]
        for name in names:
            groups.setdefault(name, []).append(g)
    wanted = ("place", "joint", "first", "both", "false_alarm", "unknown_found", "clean", "onset")
    out = {}
    for name, group in sorted(groups.items()):
        claims = [claim for g in group for claim in g.claims]
        out[name] = {score: _share(score, group) for score in wanted} | {"log_score": log_score(claims)}
    return out


def failures(grades: list[Grade]) -> list[dict[str, Any]]:
    """Kinds of failure, the most frequent first, each with an example."""
    classes: dict[tuple[str, str, str], list[Grade]] = {}
    for g in grades:
        wrong = g.false_alarm or g.first is False or g.both is False or g.unknown_found is False
        if wrong:
            classes.setdefault((g.kind, g.effect, g.called), []).append(g)
    ordered = sorted(classes.items(), key=lambda item: -len(item[1]))
    return [
        {"kind": k, "effect": e, "called": c, "count": len(gs), "example": gs[0].number, "motion": gs[0].motion}
        for (k, e, c), gs in ordered
    ]


def draw_confusion(grades: list[Grade], path: Path) -> None:
    """Draw the confusion matrix: concealed effects against the first findings."""
    singles = [g for g in grades if g.kind in {"single", "outside", "null"}]
    rows = sorted({g.effect for g in singles})
    columns = sorted({g.called for g in singles})
    counts = np.array([[sum(g.effect == r and g.called == c for g in singles) for c in columns] for r in rows])
    figure, axis = plt.subplots(figsize=(0.3 * len(columns) + 3.2, 0.26 * len(rows) + 2.4))
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    axis.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for r in range(len(rows)):
        for c in range(len(columns)):
            if counts[r, c]:
                dark = shares[r, c] > 0.5
                axis.text(c, r, str(counts[r, c]), ha="center", va="center", fontsize=7, color="w" if dark else "k")
    axis.set_xticks(range(len(columns)), columns, rotation=90, fontsize=7)
    axis.set_yticks(range(len(rows)), rows, fontsize=7)
    axis.set_xlabel("named first")
    axis.set_ylabel("hidden (alone, at 2 and 5 times its limit)")
    _save(figure, path)


def draw_reliability(bins: list[dict[str, float]], path: Path) -> None:
    """Draw the claimed probabilities against the shares of right findings."""
    figure, axis = plt.subplots(figsize=(4.2, 3.6))
    axis.plot([0, 1], [0, 1], color="0.7", lw=1)
    axis.plot([b["claimed"] for b in bins], [b["right"] for b in bins], "o-", color="#1f6aa5")
    for b in bins:
        axis.annotate(
            f"{b['count']:.0f}", (b["claimed"], b["right"]), xytext=(4, -10), textcoords="offset points", fontsize=8
        )
    axis.set_xlabel("claimed probability")
    axis.set_ylabel("share of right findings")
    axis.set_xlim(0.0, 1.02)
    axis.set_ylim(0.0, 1.02)
    _save(figure, path)


def _save(figure: Any, path: Path) -> None:
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    plt.close(figure)


def shown(name: str, value: float) -> str:
    """A score [-] as text: a share in percent, a score of probabilities as a number."""
    return f"{value:.3f}" if name in {"brier", "log_score"} else f"{100.0 * value:.1f} %"


def met(name: str, value: float | None) -> bool | None:
    """Whether a score [unit of its goal] reaches its goal; None where there is no goal or no score."""
    goal = GOALS.get(name)
    if goal is None or value is None:
        return None
    compare: Callable[[float], bool] = (lambda v: v >= goal[1]) if goal[0] == ">=" else (lambda v: v <= goal[1])
    return compare(value)
