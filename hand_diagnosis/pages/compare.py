"""compare.html and compare.json: two results side by side, as sentences, a table and plots; here, two reports."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from hand_diagnosis.pages.drawing import tint
from hand_diagnosis.pages.error_chart import ErrorChart, error_chart
from hand_diagnosis.pages.headline import common_words, effect_words, errors, multiple, title, words_of
from hand_pages.page import write_html
from hand_pages.plots import Plot
from hand_pages.results import made_rows

Kind = Literal["report", "model", "recording"]


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell of a table. tint: opacity of its colour, 0 to 1 [-]."""

    text: str
    tint: float = 0.0


@dataclass(frozen=True, slots=True)
class Comparison:
    """title: the answer.  sentences: one for each side, and remarks.  head, rows: of the table.  plots: may be none.

    document: the same for programs.  errors: of two reports.
    """

    title: str
    sentences: tuple[str, ...]
    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    document: dict[str, Any]
    plots: tuple[Plot, ...] = ()
    errors: ErrorChart | None = None


def kind_of(path: Path) -> Kind:
    """What a path holds, by its name: a report.json or its folder, a hand.yaml, else a recording."""
    if path.suffix == ".json" or (path / "report.json").is_file():
        return "report"
    return "model" if path.suffix in {".yaml", ".yml"} else "recording"


def load_report(path: Path) -> dict[str, Any]:
    """A report.json, or that of a folder. ValueError, one line, for another file."""
    file = path / "report.json" if path.is_dir() else path
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{file} is not JSON: {error}") from None
    if not isinstance(content, dict) or content.get("schema") != 2 or "findings" not in content:
        raise ValueError(f"{file} is not a report of hand diagnose with schema 2")
    return content


def compare_reports(first: Mapping[str, Any], second: Mapping[str, Any]) -> Comparison:
    """Findings that only one has, and the errors of every joint or axis and signal in both."""
    both = (first, second)
    words = common_words(map(words_of, both))
    found = [{(each["joint"] or words.whole, each["effect"]) for each in report["findings"]} for report in both]
    groups = {"Only in A": found[0] - found[1], "Only in B": found[1] - found[0], "In both": found[0] & found[1]}
    named = {
        where: [f"{effect_words(effect)} of {joint}" for joint, effect in sorted(group)]
        for where, group in groups.items()
    }
    parts = [f"{where}: {', '.join(names)}" for where, names in named.items() if names]
    known = [errors(report) for report in both]
    rows, numbers = [], []
    for key in sorted(set(known[0]) | set(known[1])):
        cells = [_error_cell(errors_of.get(key)) for errors_of in known]
        rows.append((Cell(key[0]), Cell(key[1]), *cells))
        numbers.append({"joint": key[0], "signal": key[1], "a": known[0].get(key), "b": known[1].get(key)})
    answers = [f"{side}: {title(report, *words_of(report))}" for side, report in zip("AB", both, strict=True)]
    return Comparison(
        "; ".join(parts) or "Neither report has a finding",
        tuple(answers),
        (words.axis, "signal", "A: error before → after", "B: error before → after"),
        tuple(rows),
        {"kind": "report", "findings": named, "errors": numbers},
        errors=error_chart(known[0], known[1]),
    )


def _error_cell(row: Mapping[str, Any] | None) -> Cell:
    if row is None:
        return Cell("-")
    text = f"{row['rmse_before']:.3g} → {row['rmse_after']:.3g} {row['unit']} (noise {row['noise_floor']:.2g})"
    return Cell(text, tint(multiple(row, "rmse_before")))


def write_comparison(
    comparison: Comparison, names: tuple[str, str], out: Path, made: Mapping[str, object] | None = None
) -> dict[str, Any]:
    """Write compare.json and compare.html into a folder, made where it is missing; the content of the first.

    names: what A and B are.  made: how, see hand_pages/results.
    """
    out.mkdir(parents=True, exist_ok=True)
    content = {"a": names[0], "b": names[1], "answer": comparison.title, **comparison.document}
    (out / "compare.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    values = {"comparison": comparison, "names": names, "made": made_rows(made or {})}
    write_html(out / "compare.html", "hand_diagnosis", "compare.html", **values)
    return content
