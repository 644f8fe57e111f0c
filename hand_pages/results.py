"""Pages of results: an answer, its numbers as tiles, and sections of text, tables, plots and pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from hand_pages.page import write_html
from hand_pages.plots import Plot

MADE = ("date", "version", "command", "seed", "commit", "duration", "machine", "model")
"""What a page says about how it was made, in this order."""


@dataclass(frozen=True, slots=True)
class Table:
    """Cells of text below names of columns. bold: the text of cells that are written in bold."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    bold: str = ""


@dataclass(frozen=True, slots=True)
class Picture:
    """A PNG and its result in a sentence, for who does not see it."""

    png: bytes
    alt: str


@dataclass(frozen=True, slots=True)
class Section:
    """A part of the page. text: paragraphs.  folded: shown when it is opened."""

    title: str
    text: Sequence[str] = ()
    tables: Sequence[Table] = ()
    plots: Sequence[Plot] = ()
    pictures: Sequence[Picture] = ()
    folded: bool = False


@dataclass(frozen=True, slots=True)
class Results:
    """A whole page. title: the answer in one sentence.  about: what was done.  tiles: a number and its words each.

    made: what is known of date, version, command, seed, commit, duration_s, machine, model and model_sha256.
    """

    title: str
    about: str
    tiles: Sequence[tuple[str, str]]
    sections: Sequence[Section]
    made: Mapping[str, object]


def write_results(path: Path, results: Results) -> None:
    """Write the page as one file; its folder exists. Raises OSError where it cannot be written."""
    write_html(path, "hand_pages", "results.html", page=results, made=made_rows(results.made))


def made_rows(made: Mapping[str, object]) -> list[tuple[str, str]]:
    """How a page was made, by name, without what is not known."""
    known = {name: str(value) for name, value in made.items() if value not in (None, "")}
    if "duration_s" in known:
        known["duration"] = f"{known['duration_s']} s"
    if "model" in known and "model_sha256" in known:
        known["model"] = with_hash(known["model"], known["model_sha256"])
    return [(name, known[name]) for name in MADE if name in known]


def with_hash(path: object, sha256: str) -> str:
    """A file with the beginning of its hash, as pages name it."""
    return f"{path} (sha256 {sha256[:16]})"
