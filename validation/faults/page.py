"""The table of docs/safety.md: the rows of every safety function, with what the campaign measured."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from validation.tables import markdown, source_line

ROWS = Path(__file__).parent / "rows"
ROOT = Path(__file__).resolve().parents[2]
COLUMNS = ("hazard", "detection", "time", "state", "rearm", "test")
OPTIONAL = ("sites", "measured")
HEADER = ("hazard", "detection", "time", "state", "how to re-arm", "test")
TRIPPING = ("hand_control", "hand_driver", "hand_sim")
"""Packages in which a call of `trip` needs a row."""
WRAPPERS = ("trip", "_trip")
"""Functions that only pass a fault on; their callers need the row."""
GENERATED = "hand_control/safety_rules.py"
"""Its rows are generated together with it."""


class RowError(ValueError):
    """A file of rows is invalid; the message is one line."""


def rows() -> list[dict[str, Any]]:
    """Every row, in the order of the files' names. Raises RowError for a row with a key missing or unknown."""
    found = []
    for path in sorted(ROWS.glob("*.yaml")):
        for number, row in enumerate(yaml.safe_load(path.read_text(encoding="utf-8")) or (), 1):
            unknown = set(row) - {*COLUMNS, *OPTIONAL}
            missing = [key for key in COLUMNS if not str(row.get(key) or "").strip()]
            if unknown or missing:
                what = f"lacks {', '.join(missing)}" if missing else f"has the unknown key {sorted(unknown)[0]}"
                raise RowError(f"{path.name}: row {number} {what}")
            found.append(row)
    return found


def hazards_table(entry: Mapping[str, Any]) -> str:
    """The one table: hazard, detection, time, state, how to re-arm, test."""
    results = {f"{result['family']}: {result['hazard']}": result for result in entry["results"]}
    lines = []
    for row in rows():
        measured = [results[name] for name in row.get("measured", ()) if name in results]
        time = "; ".join([_cell(row["time"]), *(_measured(result) for result in measured)])
        cells = [_cell(row[key]) for key in COLUMNS]
        lines.append((*cells[:2], time, *cells[3:5], f"`{cells[5]}`"))
    return markdown(HEADER, lines)


def _measured(result: Mapping[str, Any]) -> str:
    """One measured result as a phrase."""
    cases = f"{result['cases']:,} cases"
    if result["median_s"] is None:
        return f"*measured: {cases}*"
    return f"*measured: {1e3 * result['median_s']:.0f} ms, at most {1e3 * result['max_s']:.0f} ms, {cases}*"


def results_table(entry: Mapping[str, Any]) -> str:
    """What was injected, what was handled, and what the other cases lack."""
    lines = []
    for result in entry["results"]:
        times = "" if result["median_s"] is None else f"{result['median_s']:.3f} / {result['max_s']:.3f} s"
        worst = "" if result["worst"] is None else f"{result['worst']:.3g} {result['unit']}".strip()
        worst = ", ".join(filter(None, (worst, result["note"])))
        handled = f"{result['handled']:,}"
        accepts, bounded = str(result["false_accepts"]), f"{result['bounded']:,}" if result.get("bounded") else ""
        cases, missed = f"{result['cases']:,}", missed_text(result)
        lines.append((result["family"], result["hazard"], cases, handled, bounded, missed, accepts, times, worst))
    header = (
        "family", "fault", "cases", "handled", "bounded", "what the others lack", "false accepts",
        "detection median / max", "worst",
    )  # fmt: skip
    failed = [
        f"- {r['family']}: {r['hazard']}: {_cell(r['unhandled'][0])}" for r in entry["results"] if not r["passed"]
    ]
    found = (
        "\n".join(["Not handled, with the first case of each:", "", *failed, ""])
        if failed
        else "Every fault was handled."
    )
    return f"{markdown(header, lines)}\n\n{found.strip()}\n\n{_runs(entry)}"


def _runs(entry: Mapping[str, Any]) -> str:
    """Which run gave the results; where there were several, with the families of each."""
    runs: dict[str, list[str]] = {}
    for result in entry["results"]:
        families = runs.setdefault(source_line(result.get("made", entry)), [])
        if result["family"] not in families:
            families.append(result["family"])
    return next(iter(runs)) if len(runs) == 1 else "\n".join(f"- {', '.join(of)}: {run}" for run, of in runs.items())


def missed_text(result: Mapping[str, Any]) -> str:
    """What the cases of a result lack, with their number; empty where it is not counted or nothing."""
    return ", ".join(f"{number:,} {kind}" for kind, number in result.get("misses", {}).items())


def _cell(text: object) -> str:
    return " ".join(str(text).split()).replace("|", "\\|")


def trip_sites() -> Iterator[str]:
    """Every call of a supervisor's `trip`, as path::function; a function with two calls appears twice."""
    for package in TRIPPING:
        for path in sorted((ROOT / package).glob("**/*.py")):
            name = path.relative_to(ROOT).as_posix()
            for function in _calls(ast.parse(path.read_text(encoding="utf-8")), ""):
                if name != GENERATED and function.rpartition(".")[2] not in WRAPPERS:
                    yield f"{name}::{function}"


def functions() -> set[str]:
    """Every function of these packages, as path::function."""
    found = set()
    for package in TRIPPING:
        for path in (ROOT / package).glob("**/*.py"):
            name = path.relative_to(ROOT).as_posix()
            found |= {f"{name}::{each}" for each in _names(ast.parse(path.read_text(encoding="utf-8")), "")}
    return found


def _names(tree: ast.AST, inside: str) -> Iterator[str]:
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            name = f"{inside}.{node.name}" if inside else node.name
            yield name
            yield from _names(node, name)


def _calls(tree: ast.AST, inside: str) -> Iterator[str]:
    for node in ast.iter_child_nodes(tree):
        named = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
        where = (f"{inside}.{node.name}" if inside else node.name) if named else inside  # type: ignore[attr-defined]
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in WRAPPERS:
            yield where
        yield from _calls(node, where)
