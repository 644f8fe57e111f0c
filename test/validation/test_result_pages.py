"""Pages of blind trials, real machines and injected faults: the answer is the title, and nothing is left out."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path

from matplotlib.figure import Figure

from hand_pages.page import png
from test.validation.result_documents import MADE, faults, scores
from validation import trial_page
from validation.faults import results_page as faults_page
from validation.machines import page as machines_page
from validation.results import load
from validation.trial.score import GOALS, LABELS


def text_of(path: Path) -> str:
    """What a page says, without its marks and scripts."""
    main = path.read_text(encoding="utf-8").partition("<main>")[2].partition("</main>")[0]
    return unescape(re.sub(r"<[^>]+>", " ", main))


def test_the_page_of_the_faults_names_what_is_not_handled(tmp_path: Path) -> None:
    """Fails when the title calls all well although a fault is not handled, or the case or a family is missing."""
    faults_page.write_page(tmp_path / "faults.html", faults())
    page = text_of(tmp_path / "faults.html")
    count = len(faults()["faults"])
    assert f"1 of {count} kinds of faults were not always handled: frames: a <bad> fault" in page
    assert "case 7" in page and "abc1234" in page
    assert all(result["hazard"] in page for result in faults()["faults"])
    well = faults() | {"faults": faults()["faults"][:-1]}
    assert faults_page.title(well["faults"]).startswith("Every fault was handled, in ")


def test_the_page_of_the_machines_has_every_machine_and_rival(tmp_path: Path) -> None:
    """Fails when a machine, a rival, a total with its goal or a machine that failed is missing, or marks are shown."""
    stored = load()["machines"]["results"]
    failed = [{"machine": "rig", "title": "Rig", "error": "no data"}]
    machines_page.write_page(tmp_path / "machines.html", {**MADE, **stored, "failed": failed})
    page = text_of(tmp_path / "machines.html")
    assert all(each["title"] in page for each in stored["machines"])
    assert "best of six" in page and "goal 80 %" in page and "no data" in page
    assert "`" not in page
    assert machines_page.title([]) == "No machine could be examined"


def test_the_page_of_a_trial_has_every_score_and_every_kind_of_failure(tmp_path: Path) -> None:
    """Fails when a score, its goal, a failure, the claims or the picture's result in words is missing."""
    (tmp_path / "confusion.png").write_bytes(png(Figure(figsize=(1.0, 1.0)), 10))
    trial_page.write_page(tmp_path, scores())
    page = text_of(tmp_path / "scores.html")
    assert "The effect is named first in 80% of 20 recordings" in page
    assert all(LABELS[name] in page for name in GOALS)
    assert "not reached" in page and "creep" in page and "turning weight" in page
    markup = (tmp_path / "scores.html").read_text(encoding="utf-8")
    assert re.search(r'<img alt="[^"]*leak, taken for creep in 3 cases"', markup)
    assert "Of 9 findings claimed with 60%, 70% are right" in markup
