"""Every bench in its quick form: it runs, its results have their keys, and values that are no times are plausible."""

from __future__ import annotations

import importlib
import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from validation.bench.__main__ import BENCHES, missing_tools, quick_results, table
from validation.bench.result import KEYS, figure, reached
from validation.figures import PARTS, pages, quick_fault, sections
from validation.results import load, read_run

ROOT = Path(__file__).parents[2]
UNITS = {
    "s",
    "ms",
    "us",
    "ns",
    "ns CPU/joint-step",
    "s CPU",
    "us CPU",
    "cores",
    "fraction",
    "share",
    "%",
    "deg",
    "Pa",
    "B",
    "GB",
    "cycles",
    "1/h",
    "h",
    "",
}
PLAUSIBLE: dict[str, dict[str, tuple[float, float]]] = {
    "steps": {"settling time": (0.2, 1.5), "overshoot": (0.0, 5.0)},
    "loop": {"missed periods": (0.0, 1.0)},
    "studio": {"load by other programs": (0.0, 1.0)},
    "demo": {"not named first": (0.0, 0.0)},
    "effects": {"not named first": (0.0, 0.0), "wrong place": (0.0, 0.0), "wrong joint": (0.0, 0.0)},
    "compare": {"not named": (0.0, 0.0), "worst validation error": (0.0, 1.0)},
    "control": {
        "RMS error to the target": (0.2, 1.2),
        "overshoot of this controller": (0.0, 8.0),
        "swing": (0.0, 0.0),
        "off its limit": (0.0, 20.0),
        "missed": (0.0, 50.0),
    },
    "motion": {
        "motion at rest, 95th percentile": (0.0, 0.5),
        "error at rest, 95th percentile": (0.0, 1.3),
        "false contacts": (0.0, 0.0),
        "rests that oscillate": (0.0, 2.0),
    },
    "grasp": {"vent themselves": (0.0, 0.0), "not done": (0.0, 0.0), "not reported": (0.0, 0.0), "peak": (0.8, 2.0)},
    "found": {"smooth motion": (0.0, 0.4), "steps": (0.0, 1.5)},
    "firmware": {"flash": (1e3, 64e3), "ram": (1e3, 64e3), "cycles": (1e3, 168e3)},
}
"""Bounds of values by a part of their name: no time of this machine is among them."""


MARKS: dict[str, list[Any]] = {"loop": [pytest.mark.real_time], "studio": [pytest.mark.real_time]}


@pytest.mark.parametrize("name", [pytest.param(name, marks=MARKS.get(name, [])) for name in BENCHES])
def test_the_quick_form_runs(name: str) -> None:
    """Fails when a bench no longer runs, a key is missing, a value is implausible, or a document has another format."""
    if missing := missing_tools(name):
        pytest.skip(f"this machine lacks {missing}")
    results = list(quick_results(name))
    assert results
    for result in results:
        check_schema(result)
    for part, (low, high) in PLAUSIBLE.get(name, {}).items():
        found = [result["ours"] for result in results if part in result["name"]]
        assert found, f"no result of {name} is named {part}"
        assert all(low <= value <= high for value in found), (part, found)
    json.dumps(results)
    assert table(results).row_count == len(results)
    check_sections(name, results)


def check_sections(name: str, results: list[dict[str, Any]]) -> None:
    """The sections of the documents that show this bench have the format that the quick results give."""
    for page in pages():
        for command, content in sections(page.read_text(encoding="utf-8")):
            if command in PARTS and PARTS[command].source == f"bench/{name}":
                part, stored = PARTS[command], load().get(f"bench/{name}")
                if stored is None:
                    assert part.missing and part.missing in content
                else:
                    assert quick_fault(part, content, stored, results) == ""


def check_schema(result: dict[str, Any]) -> None:
    """Every key with its type; the ratio belongs to the reference."""
    assert set(result) - {"rows"} == set(KEYS)
    assert isinstance(result["name"], str) and result["name"] == result["name"].strip() != ""
    assert result["unit"] in UNITS, result["unit"]
    for key in ("ours", "reference", "ratio", "goal"):
        value = result[key]
        assert value is None or (isinstance(value, float | int) and math.isfinite(value)), (key, value)
    assert result["ours"] is not None and result["ours"] >= 0.0
    if result["reference"]:
        assert result["ratio"] is not None and result["ratio"] > 0.0
    reached(result)


def test_what_a_diagnosis_found_reaches_the_controller() -> None:
    """Fails when the stored model of a diagnosis of friction no longer halves the error of smooth motion."""
    results = {result["name"]: result for result in quick_results("found")}
    ratio = results["friction: RMS error of smooth motion (reference: nominal description)"]["ratio"]
    assert 0.0 < ratio < 0.5


def test_every_bench_is_listed() -> None:
    """Fails when a module of validation.bench is not run by `python -m validation.bench`."""
    modules = {path.stem.removeprefix("bench_") for path in (ROOT / "validation" / "bench").glob("bench_*.py")}
    assert modules == set(BENCHES)
    for name in BENCHES:
        assert callable(importlib.import_module(f"validation.bench.bench_{name}").run)


def test_a_goal_bounds_the_ratio_or_the_value() -> None:
    """Fails when a goal is compared with the wrong number."""
    assert reached(figure("a", 3.0, 0.5, "s", 10.0)) is True
    assert reached(figure("a", 3.0, 2.0, "s")) is False
    assert reached(figure("a", 3.0, None, "s")) is None


def bench(*arguments: str, path: str | None = None) -> subprocess.CompletedProcess[str]:
    environment = None if path is None else {"PATH": path, "PYTHONPATH": ":".join(filter(None, sys.path))}
    return subprocess.run(
        [sys.executable, "-m", "validation.bench", *arguments],
        cwd=ROOT, env=environment, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip


def test_a_missing_tool_is_one_line(tmp_path: Path) -> None:
    """Fails when a machine without compiler or emulator gets a traceback, or a file of results without results."""
    out = tmp_path / "bench.json"
    done = bench("--only", "firmware", "--quick", "--out", str(out), path=str(tmp_path))
    assert done.returncode == 2
    assert "firmware: skipped, it needs arm-none-eabi-gcc and qemu-system-arm" in " ".join(done.stdout.split())
    assert "Traceback" not in done.stderr and not out.exists()


def test_quick_results_are_not_stored(tmp_path: Path) -> None:
    """Fails when numbers of a quick bench could reach the documents as a measurement."""
    out = tmp_path / "bench.json"
    document = {"date": "", "commit": "", "machine": "", "quick": True, "benches": {"steps": []}, "skipped": {}}
    out.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(ValueError, match="no measurement"):
        read_run(out)
    out.write_text(json.dumps(document | {"quick": False}), encoding="utf-8")
    assert read_run(out)["bench/steps"]["command"] == "python -m validation.bench --only steps"
    out.write_text("[]", encoding="utf-8")
    with pytest.raises(ValueError, match="no results of benches"):
        read_run(out)
