"""The site of the documents: every page has its place, and links to files outside docs/ become their names."""

from __future__ import annotations

import itertools
import runpy
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parent.parent


def pages(entry: Any) -> Iterator[str]:
    """Names of the pages below an entry of the navigation."""
    if isinstance(entry, str):
        yield entry
    else:
        for part in entry.values() if isinstance(entry, dict) else entry:
            yield from pages(part)


def test_every_document_has_its_place() -> None:
    """Fails when a document is missing in the navigation of the site, or stands there twice or without a file."""
    navigation = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]
    assert sorted(pages(navigation)) == sorted(path.name for path in (ROOT / "docs").glob("*.md"))


def test_links_out_of_the_site_become_names() -> None:
    """Fails when a link leaves the site, a link inside it is changed, or one that leads nowhere is kept."""
    hook = runpy.run_path(str(ROOT / "tools" / "docs_site.py"))["on_page_markdown"]
    text = "[the examples](../examples/README.md) and [the model](model.md#effects)"
    assert hook(text) == "the examples (`examples/README.md`) and [the model](model.md#effects)"
    with pytest.raises(FileNotFoundError, match="no/such"):
        hook("[a](../no/such)")


def test_code_and_paragraphs_of_list_items_are_indented_for_the_site() -> None:
    """Fails when a paragraph or code inside a list item is indented for GitHub alone.

    The site needs a multiple of four spaces, else code becomes prose and the next item begins again at 1.
    """
    wrong = []
    for path in sorted((ROOT / "docs").glob("*.md")):
        lines = path.read_text(encoding="utf-8").splitlines()
        for number, (before, line) in enumerate(itertools.pairwise(lines), 2):
            spaces = len(line) - len(line.lstrip())
            if line and not before and spaces % 4:
                wrong.append(f"{path.name}:{number}: {spaces} spaces")
    assert wrong == []
