"""The campaign of faults in its quick form, and docs/safety.md: every safety function has a row with its test."""

from __future__ import annotations

import ast
import json
from collections import Counter
from fnmatch import fnmatch
from pathlib import Path

import pytest

from validation.faults import page
from validation.faults.__main__ import FAMILIES, SEED, is_there, main, run
from validation.faults.result import FaultResult, Size, Tally
from validation.figures import PARTS
from validation.results import load, read_run

ROOT = Path(__file__).parents[2]


FOUND_S = {
    "angle frozen": 0.1,
    "angle mirrored": 0.02,
    "angle negated": 0.02,
    "angles exchanged": 0.02,
    "pressure frozen": 0.1,
    "pressures exchanged": 0.25,
    "pressure x 0.5": 0.02,
    "pressure x 2": 0.02,
    "pressure at 0": 0.02,
    "converter stuck": 0.02,
    "supply 6.5 V": 0.01,
    "valve stuck": 0.4,
    "angle mirrored, from the start": 0.02,
    "angle negated, from the start": 0.02,
    "angles exchanged, from the start": 1.9,
    "pressures exchanged, from the start": 0.25,
    "pressure x 0.5, from the start": 1.1,
    "pressure x 2, from the start": 0.2,
    "pressure at 0, from the start": 1.0,
}
"""Latest time [s] until a fault of the quick form is found; the contract of validation.faults.sensors is wider."""
MISSED = {
    "angles exchanged, from the start": {"late": 4, "excess": 1},
    "pressure x 0.5, from the start": {"excess": 1},
}
"""What the quick form does not meet of its contract, with the number of cases; docs/safety.md gives the reasons."""


def check_figures(found: dict[str, FaultResult]) -> None:
    """Fail when a fault of a sensor is found later than before, or another number of cases misses the contract."""
    assert set(found) - {"operation without a fault"} == set(FOUND_S)
    assert {hazard: result.misses for hazard, result in found.items() if result.misses} == MISSED
    for hazard, latest_s in FOUND_S.items():
        result = found[hazard]
        assert result.max_s is not None and result.max_s <= latest_s, (hazard, result.max_s)


@pytest.mark.parametrize("family", [name for name in FAMILIES if is_there(name)])
def test_every_fault_of_the_quick_form_is_handled(family: str) -> None:
    """Fails when an injected fault is not handled as required, or a damaged input passes as good.

    Also when a fault of a sensor that is known to miss its contract gets better or worse: then MISSED is to be changed.
    """
    print(f"seed {SEED}")
    results = run(family, Size.QUICK, SEED)
    assert results
    wrong = {f"{result.family}: {result.hazard}": result for result in results if not result.passed}
    if family == "sensors":
        check_figures({result.hazard: result for result in results})
        wrong = {name: result for name, result in wrong.items() if result.hazard not in MISSED}
    assert not wrong, {name: result.unhandled for name, result in wrong.items()}


def test_a_row_names_a_test_that_exists() -> None:
    """Fails when a row of the table names a test that pytest does not collect, or lacks one of its columns."""
    names = sorted({row["test"] for row in page.rows()})
    assert len(names) > 10
    missing = [name for name in names if name.partition("::")[2] not in _tests_of(ROOT / name.partition("::")[0])]
    assert not missing


def _tests_of(file: Path) -> set[str]:
    """Names of the tests that pytest collects in a file: functions that begin with test_, without those marked long."""
    assert fnmatch(file.name, "test_*.py"), file
    functions = [node for node in ast.parse(file.read_text(encoding="utf-8")).body if isinstance(node, ast.FunctionDef)]
    long = {
        each.name for each in functions if any(ast.unparse(mark) == "pytest.mark.long" for mark in each.decorator_list)
    }
    return {each.name for each in functions if each.name.startswith("test_")} - long


def test_every_trip_has_a_row() -> None:
    """Fails when code latches a fault that the table does not list, or a row names a function that is not there."""
    in_code = Counter(page.trip_sites())
    listed = Counter(site for row in page.rows() for site in row.get("sites", ()))
    assert not in_code - listed, "add `sites: [path::function]` to a row of validation/faults/rows for each"
    assert set(listed) <= page.functions(), "these functions of the rows are not there"


def test_measured_results_are_those_of_the_campaign() -> None:
    """Fails when a row shows a result that the stored campaign does not have."""
    known = {f"{result['family']}: {result['hazard']}" for result in load()["faults"]["results"]}
    shown = {name for row in page.rows() for name in row.get("measured", ())}
    assert shown
    assert shown <= known


def test_a_fault_that_is_not_handled_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when an unhandled case leaves the exit code at 0, or its name out of the file."""
    tally = Tally("frames", "damaged", 7)
    tally.case("good", True, 0.1)
    tally.case("the bad one", False, 0.3)
    monkeypatch.setattr("validation.faults.__main__.run", lambda *_: [tally.result()])
    out = tmp_path / "faults.json"
    assert main(["--only", "frames", "--quick", "--out", str(out)]) == 1
    (stored,) = json.loads(out.read_text(encoding="utf-8"))["faults"]
    assert stored["unhandled"] == ["the bad one"] and not stored["passed"]
    assert (stored["median_s"], stored["max_s"]) == (pytest.approx(0.2), 0.3)
    with pytest.raises(ValueError, match="the quick form of the campaign"):
        read_run(out)


def test_families_are_stored_apart_with_their_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when faults of processes cannot be stored, or a family that was not run is lost or gets another's run."""
    live = FaultResult("floods", "flood", 4, 3, ("huge: 8.0% of the periods missed",), unit="MB growth", worst=2.0)
    about = {"command": "x", "date": "2026-01-02", "commit": "abc1234", "machine": "2 cores"}
    before = {"faults": {**about, "command": "make faults", "results": [FaultResult("board", "deaf", 1, 1).as_dict()]}}
    monkeypatch.setattr("validation.results.load", lambda: before)
    path = tmp_path / "faults.json"
    faults = [each.as_dict() for each in (FaultResult("frames", "damaged", 2, 2, misses={"late": 1}), live)]
    path.write_text(json.dumps({**about, "date": "2026-03-04", "size": "full", "faults": faults}), encoding="utf-8")
    stored = read_run(path)
    text = PARTS["make faults FULL=1 # results"].text(stored)
    assert "| floods | flood | 4 | 3 |" in text and "huge: 8.0% of the periods missed" in text
    assert text.endswith("Made by `make faults FULL=1` on 2026-03-04, on 2 cores, at commit abc1234.")
    text = PARTS["make faults # results"].text(stored)
    assert "| frames | damaged | 2 | 2 |  | 1 late | 0 |" in text
    assert (
        "- board: Made by `make faults` on 2026-01-02" in text and "- frames: Made by `make faults` on 2026-03" in text
    )


def test_a_false_accept_or_nothing_at_all_is_not_passed() -> None:
    """Fails when a family passes that injected nothing, or that accepted damaged input."""
    assert FaultResult("a", "b", 3, 3).passed
    assert not FaultResult("a", "b", 3, 3, false_accepts=1).passed
    assert not FaultResult("a", "b", 0, 0).passed
    assert not FaultResult("a", "b", 3, 2).passed
