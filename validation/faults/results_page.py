"""faults.html: what was injected, what was not handled, and how soon faults were detected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hand_pages.results import Results, Section, Table, write_results
from validation.faults.page import missed_text

HEAD = (
    "fault",
    "handled",
    "what the others lack",
    "damaged data accepted",
    "detected, median",
    "detected, longest",
    "worst",
)
Fault = Mapping[str, Any]


def write_page(path: Path, document: Mapping[str, Any]) -> None:
    """Write the page. document: the content of faults.json."""
    faults: Sequence[Fault] = document["faults"]
    failed = [fault for fault in faults if not fault["passed"]]
    cases = sum(fault["cases"] for fault in faults)
    slowest = max((fault["max_s"] for fault in faults if fault["max_s"] is not None), default=None)
    tiles = [
        (f"{len(faults) - len(failed)} of {len(faults)}", "kinds of faults handled in every case"),
        (f"{cases:,}", "injected cases"),
        (f"{sum(fault['false_accepts'] for fault in faults):,}", "damaged inputs accepted as good"),
    ]
    if slowest is not None:
        tiles.append((f"{1e3 * slowest:.0f} ms", "longest time from a fault to the reaction"))
    about = f"Faults injected into driver, controller and simulation; size {document['size']}."
    results = Results(title(faults), about, tiles, _sections(faults, failed), document)
    write_results(path, results)


def title(faults: Sequence[Fault]) -> str:
    """The answer in one line."""
    failed = [f"{fault['family']}: {fault['hazard']}" for fault in faults if not fault["passed"]]
    if not failed:
        return f"Every fault was handled, in {sum(fault['cases'] for fault in faults):,} cases"
    more = f" and {len(failed) - 1} more" if len(failed) > 1 else ""
    return f"{len(failed)} of {len(faults)} kinds of faults were not always handled: {failed[0]}{more}"


def _sections(faults: Sequence[Fault], failed: Sequence[Fault]) -> list[Section]:
    found = []
    if failed:
        rows: list[tuple[str, ...]] = [
            (each["family"], each["hazard"], _of(each), "; ".join(each["unhandled"])) for each in failed
        ]
        found.append(Section("Not always handled", tables=[Table(("family", "fault", "handled", "not handled"), rows)]))
    for family in dict.fromkeys(fault["family"] for fault in faults):
        rows = [_row(fault) for fault in faults if fault["family"] == family]
        found.append(Section(f"Faults of {family}", tables=[_without_empty_columns(rows)]))
    return found


def _row(fault: Fault) -> tuple[str, ...]:
    times = ["" if fault[key] is None else f"{1e3 * fault[key]:.0f} ms" for key in ("median_s", "max_s")]
    worst = "" if fault["worst"] is None else f"{fault['worst']:.3g} {fault['unit']}".strip()
    accepted = f"{fault['false_accepts']:,}" if fault["false_accepts"] else ""
    return fault["hazard"], _of(fault), missed_text(fault), accepted, *times, worst


def _of(fault: Fault) -> str:
    return f"{fault['handled']:,} of {fault['cases']:,}"


def _without_empty_columns(rows: Sequence[tuple[str, ...]]) -> Table:
    kept = [k for k in range(len(HEAD)) if any(row[k] for row in rows)]
    return Table([HEAD[k] for k in kept], [[row[k] for k in kept] for row in rows])
