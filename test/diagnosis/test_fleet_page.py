"""The index of many diagnoses in a browser: filter, order, links and trend, also of ten thousand recordings."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from hand_diagnosis.pages.fleet_page import write_index
from validation.browser import Browser

MANY = 10_000
KINDS = 4
DAY_S = 86400.0


def write_report(folder: Path, number: int) -> Path:
    """A report whose index_distal misses by 10 times its number, and is explained from number 2 on."""
    folder.mkdir()
    errors = {"rmse_before": 0.1 * number, "rmse_after": 0.01, "noise_floor": 0.01}
    fit = [{"joint": "index_distal", "signal": "angle", "unit": "deg", "split": "test"} | errors]
    finding = {"joint": "index_distal", "effect": "backlash", "probability": 0.9, "alternatives": [], "tied_with": []}
    verdict = "explained" if number > 1 else "agrees"
    found = [finding | {"parameters": {}}] if number > 1 else []
    content = {"schema": 2, "verdict": verdict, "findings": found, "remainder": [], "not_judged": [], "fit": fit}
    (folder / "report.json").write_text(json.dumps(content), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """The index of MANY recordings with reports of KINDS kinds, and one that could not be used."""
    out = tmp_path_factory.mktemp("fleet")
    folders = [write_report(out / f"report_{k}", k) for k in range(KINDS)]
    recordings = [out / f"run_{k}.mcap" for k in range(KINDS)]
    for k, path in enumerate(recordings):
        path.write_bytes(b"x")
        os.utime(path, (k * DAY_S, k * DAY_S))
    bad = out / "bad.mcap"
    entries = [(recordings[k % KINDS], folders[k % KINDS]) for k in range(MANY)] + [(bad, out / "none")]
    write_index(entries, {str(bad): "<it> is empty"}, out)
    browser = Browser(tmp_path_factory.mktemp("browser"), "about:blank")
    browser.emulate((360, 700))
    browser.open((out / "index.html").as_uri())
    browser.until("document.querySelectorAll('#recordings tbody tr').length === 200")
    yield browser
    browser.close()


def shown(page: Browser, column: int) -> list[str]:
    cells: list[str] = page.run(
        f"[...document.querySelectorAll('#recordings tbody tr')].map(r => r.children[{column}].innerText)"
    )
    return cells


def choose(page: Browser, name: str, value: str) -> str:
    """Set a filter; what the page counts then."""
    page.run(f"(e => {{ e.value = {json.dumps(value)}; e.dispatchEvent(new Event('input')); }})({name})")
    return str(page.run("document.getElementById('count').textContent"))


def test_the_title_counts_what_differs(page: Browser) -> None:
    """Fails when a recording that agrees counts as different, or one that could not be used is left out."""
    half = MANY * (KINDS - 2) // KINDS
    assert page.run("document.title") == f"{half} of {MANY + 1} recordings differ from the model; 1 could not be used"


def test_filters_and_order(page: Browser) -> None:
    """Fails when a filter keeps a row that it excludes, or an error is sorted as a word."""
    quarter = MANY // KINDS
    assert choose(page, "text", "backlash run_3").startswith(f"{quarter} of ")
    assert set(shown(page, 2)) == {"explained"}
    assert choose(page, "text", "").startswith(f"{MANY + 1} of ")
    assert choose(page, "verdict", "unusable").startswith("1 of ")
    assert shown(page, 1) == ["<it> is empty"]
    assert choose(page, "verdict", "").startswith(f"{MANY + 1} of ")
    assert choose(page, "joint", "0").startswith(f"{quarter * (KINDS - 1)} of ")
    page.click("index_distal")
    assert set(shown(page, 4)) == {"30"}
    page.click("index_distal")
    assert set(shown(page, 4)) == {"10"}
    choose(page, "joint", "")
    page.click("show more")
    assert len(shown(page, 0)) == 400


def test_rows_lead_to_reports_and_the_page_fits(page: Browser) -> None:
    """Fails when a link is wrong, the page scrolls sideways at 360 px, or the trend is not drawn or said."""
    links = page.run("[...document.querySelectorAll('td a')].map(a => a.getAttribute('href'))")
    assert links and set(links) <= {f"report_{k}/report.html" for k in range(KINDS)}
    assert page.run("document.documentElement.scrollWidth") == 360
    page.run("document.querySelector('figure.plot').scrollIntoView()")  # a plot is drawn when it comes near
    page.until("document.querySelector('figure.plot > svg path.curve')")
    alt = page.run("document.querySelector('figure.plot').getAttribute('aria-label')")
    assert alt == "Error of index_distal from 0 to 30 times the noise, from 1970-01-01 00:00:00 on"
