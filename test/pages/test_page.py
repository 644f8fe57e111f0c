"""HTML pages from templates: escaped, complete, without the network."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from jinja2 import UndefinedError
from matplotlib.figure import Figure

from hand_pages.page import data_uri, png, write_html

PACKAGES = {"hand_diagnosis": "report.html", "hand_tool": "demo_page.html", "validation.paper": "page.html"}
ROOT = Path(__file__).resolve().parents[2]


def test_values_are_escaped_and_pictures_embedded(tmp_path: Path) -> None:
    """Fails when a title with markup reaches the page as markup, or a picture is not part of the file."""
    quantity = {"quantity": "<b>", "paper": None, "ours": 1.0, "unit": "N & m", "note": ""}
    result = {"id": "f", "title": "<script>", "shows": "a", "gets": "b", "differs": "", "quantities": [quantity]}
    picture = png(Figure(figsize=(1.0, 1.0)), 10)
    assert picture.startswith(b"\x89PNG")
    write_html(tmp_path / "page.html", "validation.paper", "page.html", results=[(result, picture)])
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "<script>" not in page
    assert "&lt;script&gt;" in page
    assert "N &amp; m" in page
    assert data_uri(picture) in page


def test_a_missing_value_is_an_error(tmp_path: Path) -> None:
    """Fails when a template silently leaves out what the code does not give it."""
    with pytest.raises(UndefinedError, match="results"):
        write_html(tmp_path / "page.html", "validation.paper", "page.html")


@pytest.mark.parametrize("package", PACKAGES)
def test_every_page_extends_the_base_and_needs_no_network(package: str) -> None:
    """Fails when a page has a frame of its own, or a template loads a script, a style or a font from elsewhere."""
    text = (ROOT / package.replace(".", "/") / PACKAGES[package]).read_text(encoding="utf-8")
    assert text.startswith('{% extends "base.html" %}')
    assert not re.search(r"(src|href)=[\"'](https?:|//)|@import|<script", text)
