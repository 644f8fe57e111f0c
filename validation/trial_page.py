"""scores.html: what a blind trial found, against its goals, and where it was wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hand_pages.plots import Curve, Panel, Plot
from hand_pages.results import Picture, Results, Section, Table, write_results
from validation.trial.score import GOALS, LABELS, met, shown

TILES = ("first", "place", "false_alarm", "unknown_found")
SIGNS = {">=": "at least", "<=": "at most"}
WORDS = {True: "reached", False: "not reached", None: ""}
GROUPS = ("place", "first", "false_alarm", "unknown_found", "clean")
Scores = Mapping[str, Any]


def write_page(folder: Path, scores: Scores) -> None:
    """Write scores.html next to scores.json and its pictures. scores: its content."""
    figures = scores["scores"]
    tiles = [(_value(name, figures[name]), _counted(name, figures[name])) for name in TILES]
    results = Results(title(figures), _about(scores), tiles, _sections(folder, scores), _made(scores))
    write_results(folder / "scores.html", results)


def title(figures: Scores) -> str:
    """The answer in one line."""
    first, alarm = figures["first"], figures["false_alarm"]
    parts = []
    if first["count"]:
        parts.append(f"The effect is named first in {first['value']:.0%} of {first['count']} recordings")
    if alarm["count"]:
        number = round(alarm["value"] * alarm["count"]) or "none"
        parts.append(f"{number} of {alarm['count']} recordings without an effect gave a false alarm")
    return "; ".join(parts) or "No recording could be graded"


def _about(scores: Scores) -> str:
    return (
        f"Blind trial: effects were drawn and concealed in {scores['recordings']} recordings of the plant"
        f" {scores['plant']}; the truth was sealed before the diagnosis ran, and {scores['graded']} cases are graded."
    )


def _made(scores: Scores) -> dict[str, object]:
    return {**(scores["made"] or {}), "seed": scores["seed"], "version": (scores["tool"] or {}).get("version", "")}


def _value(name: str, figure: Scores) -> str:
    return shown(name, figure["value"]) if figure["count"] else "-"


def _counted(name: str, figure: Scores) -> str:
    words = f"{LABELS[name]}, of {figure['count']}"
    return f"{words}; goal: {_goal(name)}" if _goal(name) else words


def _goal(name: str) -> str:
    goal = GOALS.get(name)
    return f"{SIGNS[goal[0]]} {100.0 * goal[1]:.0f} %" if goal else ""


def _sections(folder: Path, scores: Scores) -> list[Section]:
    effects = [(name, str(row["cases"]), str(row["first"])) for name, row in scores["by_effect"].items()]
    wrong = [
        (row["kind"], row["effect"], row["called"], str(row["count"]), f"case {row['example']}, {row['motion']}")
        for row in scores["failures"]
    ]
    confusion = folder / "confusion.png"
    pictures = [Picture(confusion.read_bytes(), _confused(scores["failures"]))] if confusion.is_file() else []
    return [
        Section(
            "Scores", tables=[Table(("score", "value", "95 % interval", "of", "goal", ""), _rows(scores["scores"]))]
        ),
        Section("Are the probabilities right?", plots=_reliability(scores["reliability"])),
        Section(
            "Where it was wrong",
            [] if wrong else ["Every graded case is right."],
            [Table(("kind", "concealed", "named first", "cases", "example"), wrong)] if wrong else [],
            pictures=pictures,
        ),
        Section("Each effect alone", tables=[Table(("concealed", "cases", "named first"), effects)], folded=True),
        Section("By plant, motion and condition", tables=[_groups(scores["by_group"])], folded=True),
    ]


def _rows(figures: Scores) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for name, figure in figures.items():
        interval = f"{100 * figure['low']:.0f} to {100 * figure['high']:.0f} %" if figure.get("low") is not None else ""
        reached = WORDS[met(name, figure["value"])] if figure["count"] else ""
        rows.append((LABELS[name], _value(name, figure), interval, str(figure["count"]), _goal(name), reached))
    return rows


def _reliability(bins: Sequence[Mapping[str, float]]) -> list[Plot]:
    """The share of right findings over the probability that was claimed for them."""
    if not bins:
        return []
    claimed, right = (np.array([float(each[key]) for each in bins]) for key in ("claimed", "right"))
    ideal = Curve("as claimed", "quiet", np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    curves = [Curve("findings", "after", claimed, right), ideal]
    most = max(bins, key=lambda each: each["count"])
    alt = f"Of {most['count']:.0f} findings claimed with {most['claimed']:.0%}, {most['right']:.0%} are right"
    panel = Panel("share of right findings", curves, 4.0, zero=True)
    return [
        Plot(
            label="claimed probability",
            panels=[panel],
            alt=alt,
            caption=f"{alt}. On the dashed line, claims are as often right as claimed.",
        )
    ]


def _confused(failures: Sequence[Mapping[str, Any]]) -> str:
    if not failures:
        return "Concealed effects against the effects named first: all on the diagonal"
    worst = failures[0]
    return (
        "Concealed effects against the effects named first: most often wrong is"
        f" {worst['effect'] or worst['kind']}, taken for {worst['called']} in {worst['count']} cases"
    )


def _groups(groups: Mapping[str, Scores]) -> Table:
    rows = [(name, *(_share(group.get(key)) for key in GROUPS)) for name, group in groups.items()]
    return Table(("cases", *(LABELS[key] for key in GROUPS)), rows)


def _share(figure: Scores | None) -> str:
    return "" if not figure or not figure["count"] else f"{figure['value']:.0%} of {figure['count']}"
