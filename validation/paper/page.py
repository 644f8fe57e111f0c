"""The reproduction of the paper as one self-contained page and as PNGs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from hand_pages import page
from hand_pages.results import made_rows
from validation.paper.overview import HEADER, rows
from validation.paper.result import Reproduction

DPI = 130


def png(result: Reproduction) -> bytes:
    """The figure as PNG."""
    return page.png(result.figure, DPI)


def write_page(
    results: Sequence[tuple[Reproduction, bytes]], path: Path, made: Mapping[str, object] | None = None
) -> None:
    """Write the page: the overview, then per figure a heading, its plots and picture, three sentences and its numbers.

    made: how, see hand_pages/results.
    """
    values = {quantity.id: quantity.ours for result, _ in results for quantity in result.quantities}
    overview = rows(values)
    content = {"results": results, "header": HEADER, "overview": overview}
    content |= {"title": title(overview), "tiles": tiles(overview), "made": made_rows(made or {})}
    page.write_html(path, "validation.paper", "page.html", **content)


def title(overview: Sequence[Sequence[str]]) -> str:
    """The answer in one line. overview: rows below HEADER, the verdict last."""
    verdicts = [row[-1] for row in overview]
    compared = sum(verdict in {"agrees", "differs"} for verdict in verdicts)
    if not compared:
        return "Nothing of the paper was compared"
    return f"{verdicts.count('agrees')} of {compared} results of the paper agree with this code"


def tiles(overview: Sequence[Sequence[str]]) -> list[tuple[str, str]]:
    """How many rows of the overview have each verdict."""
    verdicts = [row[-1].partition(":")[0] for row in overview]
    words = {
        "agrees": "results agree",
        "differs": "results differ",
        "in use, tested": "equations and recommendations are in use and tested",
        "not reproduced": "could not be reproduced, with the reason",
        "not run": "were left out of this run",
    }
    return [(str(verdicts.count(key)), text) for key, text in words.items() if key in verdicts]
