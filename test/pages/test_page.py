"""HTML pages from templates: escaped, complete, without the network."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path

import numpy as np
import pytest
from jinja2 import UndefinedError
from matplotlib.figure import Figure

from hand_diagnosis.settings import SETTINGS
from hand_pages.page import data_uri, png, write_html
from hand_pages.plots import Curve, Panel, Plot, packed, runs
from validation.browser import Browser

PACKAGES = {"hand_diagnosis": "report.html", "hand_tool": "demo_page.html", "validation.paper": "page.html"}
ROOT = Path(__file__).resolve().parents[2]


def test_values_are_escaped_and_pictures_embedded(tmp_path: Path) -> None:
    """Fails when a title with markup reaches the page as markup, or a picture is not part of the file."""
    quantity = {"quantity": "<b>", "paper": None, "ours": 1.0, "unit": "N & m", "note": ""}
    result = {"id": "f", "title": "<script>", "shows": "a", "gets": "b", "differs": "", "quantities": [quantity]}
    result |= {"plots": []}
    picture = png(Figure(figsize=(1.0, 1.0)), 10)
    assert picture.startswith(b"\x89PNG")
    values = {"results": [(result, picture)], "header": ("<i>",), "overview": [("`a<`",)]}
    values |= {"title": "t", "tiles": [], "made": [("date", "now")]}
    write_html(tmp_path / "page.html", "validation.paper", "page.html", **values)
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "<script>" not in page.partition("</main>")[0]
    assert "<code>a&lt;</code>" in page
    assert "&lt;script&gt;" in page and "&lt;i&gt;</th>" in page
    assert "N &amp; m" in page
    assert data_uri(picture) in page


def test_a_missing_value_is_an_error(tmp_path: Path) -> None:
    """Fails when a template silently leaves out what the code does not give it."""
    with pytest.raises(UndefinedError, match="results"):
        values = dict.fromkeys(("title", "tiles", "made", "header", "overview"), ())
        write_html(tmp_path / "page.html", "validation.paper", "page.html", **values)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_page_extends_the_base_and_needs_no_network(package: str) -> None:
    """Fails when a page has a frame of its own, or a template loads a script, a style or a font from elsewhere."""
    text = (ROOT / package.replace(".", "/") / PACKAGES[package]).read_text(encoding="utf-8")
    assert text.startswith('{% extends "base.html" %}')
    assert not re.search(r"(src|href)=[\"'](https?:|//)|@import|<script [^>]*src", text)


def test_packed_values_come_back() -> None:
    """Fails when the integers of a curve lose more than half a step of its range, or a gap becomes a value."""
    values = 40.0 + np.cumsum(np.random.default_rng(3).standard_normal(500))
    values[100:110] = np.nan
    stored = packed(values)
    assert isinstance(stored, dict)
    counts = np.frombuffer(base64.b64decode(stored["int16"]), dtype="<i2")
    back = np.where(counts == -32768, np.nan, stored["offset"] + stored["scale"] * counts)
    assert np.array_equal(np.isnan(back), np.isnan(values))
    assert np.nanmax(np.abs(back - values)) <= 0.51 * (np.nanmax(values) - np.nanmin(values)) / 65533
    assert packed(np.array([1.0, np.nan])) == [1.0, None]
    constant = packed(np.full(100, 7.0))
    assert isinstance(constant, dict) and constant["offset"] + constant["scale"] * -32767 == pytest.approx(7.0)


def test_the_curves_of_a_page_stay_below_3_mb() -> None:
    """Fails when the number of samples that a page may have, as stored, leaves no room for the rest of its 3 MB."""
    stored = packed(np.linspace(0.0, 1.0, SETTINGS.page_samples))
    assert len(json.dumps(stored)) < 2_200_000


def test_runs_are_the_stretches_of_true() -> None:
    """Fails when a stretch at either end is lost or has a wrong length."""
    assert runs(np.array([True, False, True, True])) == [(0, 1), (2, 4)]
    assert runs(np.zeros(3, dtype=bool)) == []


def test_no_name_ends_the_script_of_a_plot() -> None:
    """Fails when a name with markup, as that of a recording's joint, closes the element that holds the data."""
    plot = Plot(label="</script>", panels=[Panel("<b>", [Curve("a", "after", (0.0, 0.1), np.arange(3.0))])], alt="alt")
    assert "<" not in plot.json()
    assert json.loads(plot.json())["axes"] == [{"start": 0.0, "step": 0.1}]


def test_switches_show_the_curve_of_every_combination(tmp_path: Path) -> None:
    """Fails when two switches show another variant than that of both, or the model's curve does not follow."""
    axis, level = (0.0, 1.0), np.ones(4)
    below = Curve("model", "after", axis, 0.0 * level, variants=[k * level for k in (1.0, 2.0, 3.0)])
    above = [Curve("measured", "measured", axis, 10.0 * level), Curve("model", "after", axis, 10.0 * level)]
    panels, notes = [Panel("signal", above), Panel("error", [below])], ["none off", "a off", "b off", "both off"]
    plot = Plot(label="time", panels=panels, alt="alt", switches=["a", "b"], notes=notes)
    script = (ROOT / "hand_pages" / "plots.js").read_text(encoding="utf-8")
    data = f'<script type="application/json">{plot.json()}</script>'
    figure = f'<figure class="plot" tabindex="0">{data}<figcaption></figcaption></figure>'
    (tmp_path / "page.html").write_text(f"<!doctype html>{figure}<script>{script}</script>", encoding="utf-8")
    browser = Browser(tmp_path, (tmp_path / "page.html").as_uri())
    try:
        browser.until("document.querySelector('.switches')")
        shown = []
        for name in ("a", "b", "a"):
            browser.run(
                f"[...document.querySelectorAll('.switches button')].find(b => b.innerText === '{name}').click()"
            )
            note = browser.run("document.querySelector('.switches + output').innerText")
            browser.run("document.querySelector('figure > svg').onpointermove({clientX: 150})")
            shown.append((note, browser.run("document.querySelector('svg + output').innerText")))
    finally:
        browser.close()
    assert [note for note, _ in shown] == ["a off", "both off", "b off"]
    for (_, values), error in zip(shown, (1, 3, 2), strict=True):
        assert values.endswith(f"signal, measured 10; signal, model {10 - error}; error, model {error}"), values


def test_zooming_a_plot_zooms_those_of_its_group(tmp_path: Path) -> None:
    """Fails when a key or a drag zooms one plot alone, or also a plot of another group, or 0 does not show all."""

    def figure(group: str, size: float) -> str:
        curve = Curve("a", "after", (0.0, 0.1), size * np.sin(np.arange(101.0)))
        data = Plot(label="time [s]", panels=[Panel("b", [curve])], alt="alt", group=group).json()
        script = f'<script type="application/json">{data}</script>'
        return f'<figure class="plot" tabindex="0">{script}<figcaption></figcaption></figure>'

    body = "".join(figure(group, size) for group, size in (("time", 1.0), ("time", 20.0), ("other", 1.0)))
    script, style = ((ROOT / "hand_pages" / name).read_text(encoding="utf-8") for name in ("plots.js", "style.css"))
    page = f"<!doctype html><style>{style}</style>{body}<script>{script}</script>"
    (tmp_path / "page.html").write_text(page, encoding="utf-8")
    browser = Browser(tmp_path, (tmp_path / "page.html").as_uri())
    ends = "[...document.querySelectorAll('figure > svg')].map((svg) => (list => [list[0], list[list.length - 1]])"
    ends += "([...svg.querySelectorAll('text[text-anchor=middle]')].map(t => Number(t.textContent)).slice(0, -1)))"
    try:
        browser.until("document.querySelectorAll('figure > svg path.curve').length === 3")
        shown = [browser.run(ends)]
        browser.run("document.querySelectorAll('figure')[1].focus()")
        for key in ("+", "0"):
            browser.key(key)
            shown.append(browser.run(ends))
        browser.drag("figure > svg", 0.6, 0.3)
        shown.append(browser.run(ends))
    finally:
        browser.close()
    whole = [0, 10]
    assert shown[0] == shown[2] == [whole, whole, whole]
    for first, second, other in (shown[1], shown[3]):
        assert first == second and other == whole
    assert shown[1][0] == [3, 7] or shown[1][0] == [2.5, 7.5]
    begin, end = shown[3][0]
    assert 2.0 < begin < 3.5 and 5.0 < end < 6.5


@pytest.mark.parametrize("name", ["style.css", "plots.js", "parts.html", "base.html"])
def test_what_pages_are_made_of_is_installed(name: str) -> None:
    """Fails when a part of the pages is missing in an installed package."""
    patterns = re.search(r"package_data=\{(.*?)\}", (ROOT / "setup.py").read_text(encoding="utf-8"), re.DOTALL)
    assert patterns is not None and f"*{Path(name).suffix}" in patterns.group(1)
    assert (ROOT / "hand_pages" / name).is_file()
