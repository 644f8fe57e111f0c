"""The index of many diagnoses in a browser: filter, order, links and trend, also of ten thousand recordings."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from hand_diagnosis.pages.fleet_page import Row, write_index, write_rows
from hand_diagnosis.pages.headline import Words
from hand_model.description import load_hand
from test.diagnosis.recordings import CONFIG
from validation.browser import Browser

MANY, DAY_S = 10_000, 86400.0
FIRST_S = 1_767_225_600.0
"""2026-01-01."""
MOST_BYTES = 3_000_000
FILTERED_S = 0.1
"""Most processor time from a key in the filter to the new rows; a reader notices more. It takes 0.02 s."""
JOINTS = load_hand(CONFIG).joints
WORST = JOINTS[0]


def some_rows() -> list[Row]:
    """MANY recordings, every fourth of which agrees, with answers and errors of their own, and one that is unusable."""
    rng = np.random.default_rng(1)
    print("seed 1")
    errors = np.exp(rng.normal(1.0, 1.0, (MANY, len(JOINTS)))) + np.eye(len(JOINTS))[0] * 1e3
    rows = []
    for k, ratios in enumerate(errors):
        torque, share = rng.uniform(0.005, 0.05), rng.uniform(0.5, 1.0)
        answer = f"{WORST}: Coulomb friction of {torque:.4f} ± 0.0003 N m ({share:.0%}); and 2 more"
        kinds = [("agrees", "Model and recording agree: no effect of the catalogue is missing"), ("explained", answer)]
        verdict, text = kinds[k % 4 > 0]
        each = {joint: float(f"{ratio:.3g}") for joint, ratio in zip(JOINTS, ratios, strict=True)}
        name = f"2026-{k % 12 + 1:02d}/hand_{k:05d}_run.mcap"
        date_s = FIRST_S + k * DAY_S / 30.0
        rows.append(
            Row(
                name=name,
                link=f"{k:05d}_hand_{k:05d}_run",
                verdict=verdict,
                answer=text,
                date_s=date_s,
                of_file=False,
                errors=each,
                words=Words(),
            )
        )
    return [*rows, Row("bad.mcap", answer="<it> is empty", date_s=FIRST_S)]


@pytest.fixture(scope="module")
def index(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of those recordings."""
    out = tmp_path_factory.mktemp("fleet")
    write_rows(some_rows(), "", out)
    return out / "index.html"


@pytest.fixture(scope="module")
def page(index: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """That page on a telephone."""
    browser = Browser(tmp_path_factory.mktemp("browser"), "about:blank")
    browser.emulate((360, 700))
    browser.open(index.as_uri())
    browser.until("document.querySelectorAll('#recordings tbody tr').length === 50")
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


def test_ten_thousand_recordings_stay_small_and_fast(index: Path, page: Browser) -> None:
    """Fails when texts or axes are stored again for each recording or curve, or a filter draws every row."""
    assert index.stat().st_size <= MOST_BYTES
    keys = ["hand_00", "hand_001", "friction", "hand_09 friction", ""]
    typed = f"{json.dumps(keys)}.forEach((key) => {{ text.value = key; text.dispatchEvent(new Event('input'));"
    filtered_s = page.busy_s(typed + " document.body.offsetHeight; })") / len(keys)
    print(f"{index.stat().st_size} bytes; filtered in {filtered_s:.3f} s")
    assert filtered_s <= FILTERED_S


def test_the_title_counts_what_differs(page: Browser) -> None:
    """Fails when a recording that agrees counts as different, or one that could not be used is left out."""
    found = MANY * 3 // 4
    assert page.run("document.title") == f"{found} of {MANY + 1} recordings differ from the model; 1 could not be used"


def test_filters_and_order(page: Browser) -> None:
    """Fails when a filter keeps a row that it excludes, or an error or a date is sorted as a word."""
    assert choose(page, "text", "friction hand_0012").startswith("7 of ")
    assert set(shown(page, 2)) == {"explained"}
    assert choose(page, "text", "").startswith(f"{MANY + 1} of ")
    assert choose(page, "verdict", "2").startswith("1 of ")
    assert shown(page, 1) == ["<it> is empty"] and shown(page, 3) == ["2026-01-01 00:00 *"]
    assert choose(page, "verdict", "").startswith(f"{MANY + 1} of ")
    assert choose(page, "joint", str(sorted(JOINTS).index(WORST))).startswith(f"{MANY} of ")
    page.click(WORST)
    falling = [float(text) for text in shown(page, 4 + sorted(JOINTS).index(WORST))]
    assert falling == sorted(falling, reverse=True) and falling[0] > 1000.0
    page.click("date")
    assert shown(page, 3)[:2] == ["2026-01-01 00:00", "2026-01-01 00:48"]
    choose(page, "joint", "")
    page.click("show more")
    assert len(shown(page, 0)) == 100


def test_rows_lead_to_reports_and_the_page_fits(page: Browser) -> None:
    """Fails when a link is wrong, the page scrolls sideways at 360 px, or the trend is not drawn or described."""
    choose(page, "text", "hand_00007_")
    links = page.run("[...document.querySelectorAll('td a')].map(a => a.getAttribute('href'))")
    assert links == ["00007_hand_00007_run/report.html"]
    assert page.run("document.documentElement.scrollWidth") == 360
    page.run("document.querySelector('figure.plot').scrollIntoView()")  # a plot is drawn when it comes near
    page.until("document.querySelector('figure.plot > svg path.curve')")
    alt = page.run("document.querySelector('figure.plot').getAttribute('aria-label')")
    assert alt.startswith(f"Error of {WORST} from ") and alt.endswith(" times the noise, from 2026-01-01 00:00:00 on")


def write_report(folder: Path, recorded: list[str | None] | None) -> Path:
    """A report with one error. recorded: its entry of that name; None: it has none, as in older reports."""
    folder.mkdir()
    errors = {"rmse_before": 0.1, "rmse_after": 0.01, "noise_floor": 0.01}
    fit = [{"joint": "index_distal", "signal": "angle", "unit": "deg", "split": "test"} | errors]
    content = {"schema": 2, "verdict": "agrees", "findings": [], "remainder": [], "not_judged": [], "fit": fit}
    (folder / "report.json").write_text(json.dumps(content | ({"recorded": recorded} if recorded else {})), "utf-8")
    return folder


def test_the_trend_is_over_the_dates_of_the_recordings(tmp_path: Path) -> None:
    """Fails when a copied file moves its recording in time, or a date of a file is not said to be one."""
    given: tuple[list[str | None] | None, ...] = (
        ["2026-01-01T00:00:00+00:00"],
        ["2026-01-03T12:00:00+00:00"],
        [None],
        None,
    )
    entries = []
    for k, recorded in enumerate(given):
        (tmp_path / f"run_{k}.mcap").write_bytes(b"x")
        os.utime(tmp_path / f"run_{k}.mcap", (FIRST_S + 10.0 * DAY_S,) * 2)
        entries.append((tmp_path / f"run_{k}.mcap", write_report(tmp_path / f"report_{k}", recorded)))
    write_index(entries, {}, tmp_path)
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert '"axes":[[0.0,2.5,10.0,10.0]]' in text
    assert "The dates of 2 recordings are those of the files." in text and "where a * follows" in text
    write_index(entries[:2], {}, tmp_path)
    assert "those of the file" not in (tmp_path / "index.html").read_text(encoding="utf-8")
