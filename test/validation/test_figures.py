"""Generated sections of README and docs: their commands exist, and their text is what the stored results give."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from hand_model.description import load_hand
from hand_model.geometry import link_poses
from validation import hand_picture
from validation.figures import PARTS, Part, check, fill, layout, main, pages, quick_fault, sections, take
from validation.mutation.tables import kind_of, kinds
from validation.results import ROOT, STORE, load

PROVENANCE = {"command", "date", "commit", "machine", "results"}


def shown() -> dict[str, str]:
    """Content of every section of the pages by its command."""
    return {name: content for page in pages() for name, content in sections(page.read_text(encoding="utf-8"))}


def test_every_section_is_current() -> None:
    """Fails when a page shows another number than docs/figures/results.json, or a command that makes nothing."""
    assert check(load(), run=False) == []


def test_stored_results_name_their_origin() -> None:
    """Fails when a stored result lacks command, date, commit or machine, or when no section uses it."""
    entries = load()
    for source, entry in entries.items():
        assert set(entry) == PROVENANCE, source
        assert re.fullmatch(r"\d{4}-\d\d-\d\d", entry["date"]), source
        assert re.fullmatch(r"[0-9a-f]{7,}\+?", entry["commit"]), source
    assert set(entries) <= {part.source for part in PARTS.values()}


def test_every_picture_is_generated() -> None:
    """Fails when a picture of docs/figures is shown outside a generated section, or is shown nowhere."""
    contents = shown()
    for picture in sorted(STORE.parent.glob("*.png")):
        inside = sum(picture.name in content for content in contents.values())
        anywhere = sum(page.read_text(encoding="utf-8").count(picture.name) for page in pages())
        assert inside == anywhere > 0, picture.name


def test_every_word_of_the_hand_is_inside_the_picture() -> None:
    """Fails when a line of the drawing is cut off at its right end, or an angle is written on a dashed line."""
    root = ElementTree.fromstring(hand_picture.draw(load_hand(ROOT / "config" / "hand.yaml")))
    left, _, width, _ = (float(part) for part in root.attrib["viewBox"].split())
    em = 7.0
    texts = [each for each in root.iter() if each.tag.endswith("text")]
    for text in texts:
        end = float(text.attrib["x"]) + 0.55 * em * len(text.text or "")
        assert end < left + width, text.text
    lines = [each for each in root.iter() if each.attrib.get("class") == "zero"]
    labels = [each for each in texts if each.attrib.get("class") == "turned"]
    assert len(lines) == len(labels) == 2
    for line, label in zip(lines, labels, strict=True):
        x, y = (float(label.attrib[key]) for key in ("x", "y"))
        x1, y1, x2, y2 = (float(line.attrib[key]) for key in ("x1", "y1", "x2", "y2"))
        for share in np.linspace(0.0, 1.0, 50):  # no point of the line in the box of the label
            at_x, at_y = x1 + share * (x2 - x1), y1 + share * (y2 - y1)
            assert not (x <= at_x <= x + 2.2 * em and y - 0.75 * em <= at_y <= y), label.text


def test_the_drawing_of_the_hand_is_current() -> None:
    """Fails when config/hand.yaml or the drawing changes and the picture in the documents does not."""
    drawn = hand_picture.draw(load_hand(ROOT / "config" / "hand.yaml"))
    assert (STORE.parent / hand_picture.PICTURE).read_text(encoding="utf-8") == drawn
    assert all(f">{joint}</text>" in drawn for joint in load_hand(ROOT / "config" / "hand.yaml").joints)
    root = ElementTree.fromstring(drawn)
    assert "positive angles flex" in root.attrib["aria-label"]
    hand = load_hand(ROOT / "config" / "hand.yaml")
    for joint in range(len(hand.joints)):  # the palm's z axis points out of its back
        angles = np.zeros(len(hand.joints))
        angles[joint] = 0.7
        link = hand.joints[joint].rpartition("_")[0] + "_distal_link"
        straight, bent = (link_poses(hand, each)[link] @ [0.03, 0.0, 0.0, 1.0] for each in (0.0 * angles, angles))
        assert bent[2] < straight[2], hand.joints[joint]


def test_a_changed_number_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when the check overlooks an edited number, an unknown command or a section without an end."""
    page = tmp_path / "page.md"
    monkeypatch.setattr("validation.figures.ROOT", tmp_path)
    monkeypatch.setattr("validation.figures.PAGES", ("page.md",))
    command, entries = "python -m validation.bench --only steps", load()
    page.write_text(f"a <!-- generated: {command} -->X<!-- end --> b\n", encoding="utf-8")
    page.write_text(fill(page.read_text(encoding="utf-8"), entries, page), encoding="utf-8")
    assert check(entries, run=False) == []
    text = page.read_text(encoding="utf-8")
    page.write_text(text.replace("0.", "1.", 1), encoding="utf-8")
    assert "not what its source gives" in check(entries, run=False)[0]
    page.write_text(text.replace("steps", "leaps"), encoding="utf-8")
    assert "no such command" in check(entries, run=False)[0]
    with pytest.raises(ValueError, match="nothing generates"):
        fill(page.read_text(encoding="utf-8"), entries, page)
    page.write_text(text.replace("<!-- end -->", ""), encoding="utf-8")
    assert "has no <!-- end -->" in check(entries, run=False)[0]


def test_formats_are_compared_without_their_numbers() -> None:
    """Fails when another column, another sentence or another exact number passes as the same format."""
    assert layout("It takes 0.5 s (`a`).") == layout("It takes 12 s (`a`).") != layout("It lasts 12 s (`a`).")
    assert layout("| a | b |\n| --- | --- |\n| 1 | 2 |") == layout("| a | b |\n| --- | --- |\n| x | y |\n| z | 0 |")
    assert layout("| a | b |\n| --- | --- |\n| 1 | 2 |") != layout("| a | b |\n| --- | --- |\n| 1 | 2 | 3 |")

    def render(entry: dict[str, Any]) -> str:
        return f"{entry['results'][0]} s"

    assert quick_fault(Part("x", render), "1 s", {}, [{}]) != ""
    assert quick_fault(Part("x", lambda entry: "2 s"), "1 s", {}, []) == ""
    assert quick_fault(Part("x", lambda entry: "2 s", exact=True), "1 s", {}, []) != ""


def test_bad_input_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when a file that is no run gives a traceback, or changes the stored results."""
    before = STORE.read_bytes()
    (tmp_path / "run.json").write_text("{}", encoding="utf-8")
    assert main(["--take", str(tmp_path / "run.json")]) == 2
    assert main(["--take", str(tmp_path / "nowhere")]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2 and "no results of benches" in lines[0] and "nowhere" in lines[1]
    assert STORE.read_bytes() == before
    assert ROOT in STORE.parents


def test_a_shorter_trial_does_not_replace_a_longer_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Broken by a short `make proof WRITE=1` that overwrites the scores and pictures of the long trial."""
    before = STORE.read_bytes()
    stored = load()["trial"]["results"]
    short = {**stored, "made": {}, "recordings": stored["recordings"] - 1}
    (tmp_path / "scores.json").write_text(json.dumps(short), encoding="utf-8")
    take(tmp_path)
    assert "does not replace" in capsys.readouterr().out
    assert STORE.read_bytes() == before


def test_survivors_of_mutation_runs_get_the_reason_of_their_kind() -> None:
    """Fails when a survivor gets a reason that is not its own, or a reason is kept for a line that is gone."""
    known = kinds()
    survivor = {"module": "hand_control/law.py", "before": "if a and dt > 0.0:", "after": "if a and dt != 0.0:"}
    kind = kind_of(survivor, known)
    assert kind is not None and "cannot be negative" in kind.kind
    assert kind_of({**survivor, "after": "if a and dt > 1.0:"}, known) is None
    assert kind_of({**survivor, "module": "hand_control/node.py"}, known) is None
    for each in known:
        for module, changes in each.survivors.items():
            text = (ROOT / module).read_text(encoding="utf-8")
            assert all(change.split(" -> ")[0] in text for change in changes), (module, changes)
