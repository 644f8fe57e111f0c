"""The results of the machines as Markdown for docs/proof.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hand_pages.numbers import with_error
from validation.tables import Entry, markdown, number, source_line

GOAL_RATIO = 1.1
"""Largest test error, relative to the best rival's, that counts as reached."""
WITH_REMAINDER = ("partly_explained", "unknown_physics")
"""Verdicts of a report that says that the findings do not explain all, by a remainder or a broken certificate."""
FOUND = (
    "machine",
    "verdict",
    "known by its source",
    "effects named (probability)",
    "first right",
    "decoys accepted",
)
NUMBERS = ("machine", "number", "diagnosis", "published", "within 2 standard errors", "source")
TOTALS = ("result", "reached", "goal")
RIVALS = ("re-identified", "best of six", "SINDy", "Gaussian process", "NARX")
ERRORS = ("machine", "nominal", "diagnosis", *RIVALS, "unit", "noise floor", "diagnosis / best rival", "CPU")
Machine = Mapping[str, Any]


def machines_table(entry: Entry) -> str:
    """What was found, the test errors, published numbers, and the totals."""
    machines: Sequence[Machine] = entry["results"]["machines"]
    failed = [f"- {row['title']}: {row['error']}" for row in entry["results"]["failed"]]
    lines = [found_table(machines), error_table(machines), number_table(machines), totals(machines)]
    if failed:
        lines.append("\n".join(["Not examined:", "", *failed]))
    return "\n\n".join([*lines, source_line(entry)])


def found_table(machines: Sequence[Machine]) -> str:
    """The answers: known effects, what is named, decoys."""
    return markdown(FOUND, [found_row(each) for each in machines])


def found_row(each: Machine) -> tuple[str, ...]:
    """Cells below FOUND."""
    named = ", ".join(f"`{row['effect']}` ({row['probability']:.2f})" for row in each["effects"])
    if not named and each["first"]:
        named = f"`{each['first']}` as a part of what is unknown"
    right = _right(each)
    known = ", ".join(f"`{name}`" for name in each["known"]).replace(" | ", "` or `")
    decoys = ", ".join(f"`{name}`" for name in each["decoys_taken"])
    return each["title"], each["verdict"], known, named or "none", right, decoys or "none"


def _right(each: Machine) -> str:
    """Whether the first effect named is a known one."""
    if each["right"]:
        return "in part" if each["partly"] else "yes"
    return "in its class" if each.get("in_class") else "no"


def error_table(machines: Sequence[Machine]) -> str:
    """RMS errors on the test recordings."""
    return markdown(ERRORS, [error_row(each) for each in machines])


def error_row(each: Machine) -> tuple[str, ...]:
    """Cells below ERRORS."""
    errors = [number(each["rivals"][name]) for name in RIVALS]
    shown = (number(each["nominal"]), number(each["ours"]), *errors, each["unit"], number(each["noise_floor"]))
    return each["title"], *shown, f"{ratio(each):.2f}", f"{each['cpu_s']:.0f} s"


def number_table(machines: Sequence[Machine]) -> str:
    """Published numbers compared with ours."""
    return markdown(NUMBERS, number_rows(machines))


def number_rows(machines: Sequence[Machine]) -> list[tuple[str, ...]]:
    """Rows below NUMBERS."""
    rows: list[tuple[str, ...]] = []
    for each in machines:
        for row in each["published"]:
            ours = row["ours"]
            own = "not found" if ours is None else f"{with_error(ours['value'], ours['std'])} {ours['unit']}"
            agrees = {True: "yes", False: "no", None: ""}[row["agrees"]]
            rows.append((each["title"], f"`{row['key']}`", own, number(row["published"]), agrees, row["source"]))
    return rows


def ratio(each: Machine) -> float:
    """The test error relative to the best rival's [-]."""
    return float(each["ours"] / min(each["rivals"].values()))


def totals(machines: Sequence[Machine]) -> str:
    """Counts over all machines, each with its goal."""
    return markdown(TOTALS, total_rows(machines))


def total_rows(machines: Sequence[Machine]) -> list[tuple[str, ...]]:
    """Rows below TOTALS."""
    count = len(machines)
    right = sum(each["right"] and not each["partly"] for each in machines)
    alike = sum(bool(each.get("in_class")) for each in machines)
    lowest = [ratio(each) <= GOAL_RATIO for each in machines]
    named = [low or each["verdict"] in WITH_REMAINDER for low, each in zip(lowest, machines, strict=True)]
    decoys = sum(bool(each["decoys_taken"]) for each in machines)
    rows = [row for each in machines for row in each["published"]]
    agree = sum(row["agrees"] is True for row in rows)
    slow = sum(each["cpu_s"] > 60.0 for each in machines)
    return [
        ("the first effect named is a known one", f"{right} of {count}", ""),
        (
            "the same, or the report says that the data do not separate it from one",
            f"{right + alike} of {count}",
            "80 %",
        ),
        ("machines with a decoy above 0.5", f"{decoys} of {count}", "0"),
        ("published numbers within 2 standard errors", f"{agree} of {len(rows)}", "70 %"),
        (f"test error at most {GOAL_RATIO} times the best rival's", f"{sum(lowest)} of {count}", ""),
        ("the same, or the report says that other physics is left", f"{sum(named)} of {count}", "75 %"),
        ("diagnoses of more than 60 s of CPU", f"{slow} of {count}", "0"),
    ]


def first_runs_table(entry: Entry) -> str:
    """The first run of each machine, which is the one that counts: no part of the tool had seen it.

    A run that ended without a model that predicts has no error (`ours` is None).
    """
    rows = [
        (
            each["title"],
            each["first_run"]["date"],
            each["first_run"]["commit"],
            each["verdict"],
            ", ".join(f"`{row['effect']}`" for row in each["effects"]) or "none",
            _right(each),
            f"{number(each['ours'])} {each['unit']}" if predicted else "none",
            f"{ratio(each):.2f}" if predicted else "",
        )
        for each in entry["results"]
        for predicted in [each["ours"] is not None]
    ]
    header = ("machine", "first run", "commit", "verdict", "effects named", "first right", "test error")
    return markdown((*header, "diagnosis / best rival"), rows)


def sources_table(entry: Entry) -> str:
    """Where the recordings come from."""
    rows = [
        (each["title"], f"{source['repository']}, {source['commit'][:8]}", source["licence"], source["about"])
        for each in entry["results"]["machines"]
        if "repository" in (source := each["source"])
    ]
    return markdown(("machine", "source, commit", "licence", "what it is"), rows)
