"""The reproduction of the paper as one self-contained page and as PNGs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hand_pages import page
from validation.paper.overview import HEADER, rows
from validation.paper.result import Reproduction

DPI = 130


def png(result: Reproduction) -> bytes:
    """The figure as PNG."""
    return page.png(result.figure, DPI)


def write_page(results: Sequence[tuple[Reproduction, bytes]], path: Path, made: str = "") -> None:
    """Write the page: the overview, then per figure a heading, the picture (PNG), three sentences and its numbers.

    made: a sentence with command, seed and date.
    """
    values = {quantity.id: quantity.ours for result, _ in results for quantity in result.quantities}
    page.write_html(
        path, "validation.paper", "page.html", results=results, made=made, header=HEADER, overview=rows(values)
    )
