"""Parts of the diagnosis that are switched off, the scores without them, and the scores of several plants together."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

from validation import proof
from validation.ablations import SHOWN, SWITCHES, WHOLE, main, row_of, without
from validation.proof import COUNT, DEVELOPMENT, LEAST_CASES, WORDS, shares_of, together
from validation.proof import main as prove
from validation.tables import ablations_table
from validation.trial.grade import Grade
from validation.trial.score import LABELS


def graded(number: int, *, right: bool, probability: float = 0.9) -> Grade:
    """The grade of a case with one effect, at five times its limit."""
    found = Grade(number, "single", "leak", 5.0, "steps", "leak" if right else "creep")
    found.place = found.joint = found.first = found.first_two = found.clean = right
    found.unknown_wrong = False
    found.claims = [(probability, right)]
    return found


@pytest.mark.parametrize("part", SWITCHES)
def test_a_part_is_switched_off_and_on_again(part: str) -> None:
    """Fails when a switch names what is not there, changes nothing, or stays after the run."""
    places = [(importlib.import_module(module), name) for module, name, _ in SWITCHES[part]]
    before = [getattr(module, name) for module, name in places]
    with pytest.raises(ZeroDivisionError), without(part):
        assert all(getattr(module, name) is not old for (module, name), old in zip(places, before, strict=True))
        raise ZeroDivisionError
    assert [getattr(module, name) for module, name in places] == before


def test_the_table_compares_with_all_parts() -> None:
    """Fails when a score stands in the wrong column, all parts are not first, or time is not relative to theirs."""
    whole = row_of([graded(0, right=True), graded(1, right=True)], [1.0, 3.0])
    less = row_of([graded(0, right=True), graded(1, right=False)], [0.5, 1.5])
    entry = {"command": "c", "date": "d", "commit": "e", "machine": "", "results": {"laws": less, WHOLE: whole}}
    lines = ablations_table(entry).splitlines()
    assert lines[3].startswith("| laws | 50% | 50% | 50% |") and lines[3].endswith("| 0.50 |")
    assert lines[2].endswith("| 1.00 |") and "2 recordings" in lines[5]
    assert set(SHOWN) <= set(LABELS)


def test_plants_that_count_are_scored_together() -> None:
    """Fails when a plant counts as much as another with more recordings, or a looked-at plant counts."""
    grades = {
        "a": [graded(0, right=True)],
        "b": [graded(k, right=k == 0) for k in range(3)],
        "c": [graded(0, right=True)],
    }
    runs = {name: {"grades": [vars_of(grade) for grade in of]} for name, of in grades.items()}
    scores = together(runs, ["a", "b"])
    assert scores["first"]["value"] == pytest.approx(0.5) and scores["first"]["count"] == 4
    assert scores["log_score"]["count"] == 4


def vars_of(grade: Grade) -> dict[str, object]:
    """A grade as grades.json holds it."""
    return {name: getattr(grade, name) for name in Grade.__slots__}


def test_every_plant_gets_its_share() -> None:
    """Fails when recordings are lost, a plant has too few for a trial, or looked-at plants come first."""
    counts = shares_of(600)
    assert sum(counts.values()) == 600 and list(counts)[: len(COUNT)] == list(COUNT)
    assert list(counts)[len(COUNT) :] == list(DEVELOPMENT) and set(counts) == set(WORDS)
    assert min(shares_of(20).values()) == LEAST_CASES
    assert shares_of(40, ["trial", "development"]) == {"development": 20, "trial": 20}


def test_bad_input_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when bad input gives a traceback, or a folder with results is overwritten."""
    (tmp_path / "kept").write_text("")
    assert main([str(tmp_path), "--key", "k"]) == 2
    assert main([str(tmp_path), "--key", "k", "--jobs", "0"]) == 2
    assert prove(["--cases", "4", "--out", str(tmp_path / "new")]) == 2
    assert prove(["--jobs", "0", "--out", str(tmp_path / "new")]) == 2
    assert prove(["--out", str(tmp_path)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 5 and "--cases is 4" in lines[2] and "is not an empty folder" in lines[4]


def test_an_interruption_says_what_is_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when Ctrl-C ends in a traceback, or the line names a plant whose trial was not scored."""

    def interrupted(plant: str, folder: Path, count: int, options: list[str]) -> None:
        if plant != "held_back":
            raise KeyboardInterrupt
        folder.mkdir()
        (folder / "scores.json").write_text("{}", encoding="utf-8")

    monkeypatch.setattr(proof, "run_plant", interrupted)
    assert prove(["--out", str(tmp_path / "proof")]) == proof.INTERRUPTED
    last = capsys.readouterr().err.splitlines()[-1]
    assert "scored so far: held_back;" in last and "proof.json is not written" in last
