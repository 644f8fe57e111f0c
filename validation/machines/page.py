"""machines.html: what was found on each real machine, and how well it predicts recordings that were not fitted."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from hand_diagnosis.pages.headline import effect_words
from hand_pages.results import Results, Section, Table, write_results
from validation.machines import tables
from validation.machines.tables import Machine

ABOUT = (
    "Recordings of real machines: each was diagnosed on its training recordings, and its model then predicted other"
    " recordings, next to rivals that were fitted to the same training recordings."
)
ERRORS_TEXT = (
    "RMS errors on recordings that no model was fitted to. Nominal: the machine file as given. Where the ratio in"
    " the last column but one is below 1, the diagnosis predicts better than every rival."
)
VERDICTS = ("agrees", "explained", "partly_explained", "unknown_physics")
EFFECT = re.compile(r"`([a-z_]+)`")


def write_page(path: Path, document: Mapping[str, Any]) -> None:
    """Write the page. document: the content of machines.json."""
    machines: Sequence[Machine] = document["machines"]
    totals = tables.total_rows(machines)
    tiles = [(reached, f"{what}; goal {goal}" if goal else what) for what, reached, goal in totals]
    results = Results(title(machines), ABOUT, tiles, [*_sections(machines), *_failed(document["failed"])], document)
    write_results(path, results)


def title(machines: Sequence[Machine]) -> str:
    """The answer in one line."""
    if not machines:
        return "No machine could be examined"
    best = sum(tables.ratio(each) <= 1.0 for each in machines)
    right = tables.total_rows(machines)[0][1]
    return f"A known effect is named first on {right} machines; the prediction is better than every rival's on {best}"


def _sections(machines: Sequence[Machine]) -> list[Section]:
    if not machines:
        return []
    return [
        Section("What was found", tables=[_table(tables.FOUND, map(tables.found_row, machines))]),
        Section("Errors of predictions", [ERRORS_TEXT], [_table(tables.ERRORS, map(tables.error_row, machines))]),
        Section("Published numbers", tables=[_table(tables.NUMBERS, tables.number_rows(machines))]),
        Section(
            "Findings in words",
            [f"{each['title']}: {words}" for each in machines for words in each["statements"]],
            folded=True,
        ),
    ]


def _failed(failed: Sequence[Mapping[str, str]]) -> list[Section]:
    rows = [(each["title"], each["error"]) for each in failed]
    return [Section("Not examined", tables=[Table(("machine", "reason"), rows)])] if rows else []


def _table(head: Sequence[str], rows: Iterable[tuple[str, ...]]) -> Table:
    """A table with names in words, without the marks that the documents need."""
    return Table(head, [[_words(cell) for cell in row] for row in rows])


def _words(cell: str) -> str:
    """A verdict or the marked name of an effect in words; the key of a parameter, which has a point, as it is."""
    if cell in VERDICTS:
        return cell.replace("_", " ")
    return EFFECT.sub(lambda found: effect_words(found[1]), cell).replace("`", "")
