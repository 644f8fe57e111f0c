"""The numbers of the diagnosis: all in documented classes, printed in every report, tabled in the documents."""

from __future__ import annotations

import ast
import json
import re
import sys
from collections.abc import Iterator
from dataclasses import FrozenInstanceError, fields
from pathlib import Path

import pytest

from hand_diagnosis.diagnosis import Diagnosis
from hand_diagnosis.report import document
from hand_diagnosis.settings import SETTINGS
from hand_diagnosis.settings_table import IN_FORCE, AnySettings, markdown_table

ROOT = Path(__file__).resolve().parents[2]
TABLE = ROOT / "docs" / "settings.md"
BOUNDING = {"min", "max", "clip", "quantile", "minimum", "maximum", "isclose"}
LARGEST_STRUCTURAL, GUARD = 3, 1e-6
MODULES = {
    "hand_identification": "driving free_parameters joint_data joint_problem map_fit robust_errors starts",
    "hand_recording": "hand_signals interpolation local_smoothing sample_clock signals time_base",
    "hand_machine": "balance columns derivative_window plausible reading spikes",
}
"""Modules below the diagnosis on the way from a recording to a report."""
WAY = [
    *sorted((ROOT / "hand_diagnosis").rglob("*.py")),
    *(ROOT / package / f"{name}.py" for package, names in MODULES.items() for name in names.split()),
]
USERS = [path for package in ("hand_diagnosis", *MODULES) for path in (ROOT / package).rglob("*.py")]
UNITS_AND_ORDERS = {5, 6, 0.6745, 180.0, 1e3, 1e5, 1e9}
"""Points and orders of polynomials and differences, the quartile of a normal distribution, and ratios of units."""


def is_structural(value: float) -> bool:
    """Small integers, halves and guards against division by zero decide nothing about a recording."""
    if isinstance(value, int) or float(value).is_integer():
        return abs(value) <= LARGEST_STRUCTURAL
    return abs(value) == 0.5 or abs(value) <= GUARD


def deciding_parts(tree: ast.Module) -> Iterator[ast.expr]:
    """Expressions whose numbers decide something: constants of modules and classes, defaults, comparisons, bounds."""
    for body in [tree.body, *(node.body for node in ast.walk(tree) if isinstance(node, ast.ClassDef))]:
        yield from (s.value for s in body if isinstance(s, ast.Assign | ast.AnnAssign) and s.value is not None)
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            yield node
        elif isinstance(node, ast.arguments):
            yield from (default for default in (*node.defaults, *node.kw_defaults) if default is not None)
        elif isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            yield from (*node.args, *(k.value for k in node.keywords)) if name in BOUNDING else ()


def bare_numbers(source: str) -> list[tuple[int, float]]:
    """Line and value of every number that decides something and is not structural."""
    found = set()
    for part in deciding_parts(ast.parse(source)):
        for node in ast.walk(part):
            if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
                found |= set() if is_structural(node.value) else {(node.lineno, node.value)}
    return sorted(found)


@pytest.mark.parametrize(
    "source",
    ["LIMIT = 0.3", "class A:\n    limit: float = 7.0", "def f(x, y=25): ...", "if x > 0.95: ...", "min(x, 12)"],
)
def test_a_bare_number_is_seen(source: str) -> None:
    """Fails when the walk of the next test overlooks a kind of number."""
    assert bare_numbers(source)


@pytest.mark.parametrize("path", WAY, ids=lambda path: f"{path.parent.stem}/{path.stem}")
def test_every_deciding_number_is_a_setting(path: Path) -> None:
    """Fails when a module on the way to a report has a threshold of its own instead of one of the settings."""
    if path.stem in {"settings", "fit_settings"}:
        assert len(re.findall(r"^class (?:Fit)?Settings\b", path.read_text(encoding="utf-8"), re.MULTILINE)) == 1
        return
    known = set() if path.is_relative_to(ROOT / "hand_diagnosis") else UNITS_AND_ORDERS
    assert [found for found in bare_numbers(path.read_text(encoding="utf-8")) if found[1] not in known] == []


@pytest.mark.parametrize("settings", IN_FORCE.values(), ids=IN_FORCE)
def test_every_setting_is_documented_and_used(settings: AnySettings) -> None:
    """Fails when a setting lacks its unit, meaning, source or consequences, is unused, or can be changed in place."""
    name = next(name for name, value in vars(sys.modules[type(settings).__module__]).items() if value is settings)
    sources = "\n".join(path.read_text(encoding="utf-8") for path in USERS)
    for entry in fields(settings):
        about = entry.metadata
        assert all(about[key] for key in ("unit", "meaning", "source", "halved", "doubled")), entry.name
        assert re.search(rf"\b({name}|self)\.{entry.name}\b", sources), f"{entry.name} is used nowhere"
        with pytest.raises(FrozenInstanceError):
            setattr(settings, entry.name, 5)
    with pytest.raises(TypeError):
        type(settings)(1)  # type: ignore[call-arg]


def test_the_report_prints_every_setting() -> None:
    """Fails when a report does not say with which settings it was made."""
    report = document(Diagnosis("agrees", (), (), (), (), (), False), [], "hand.yaml")
    for key, settings in IN_FORCE.items():
        printed = json.loads(json.dumps(report[key], allow_nan=False))
        assert set(printed) == {entry.name for entry in fields(settings)}
    assert report["settings"]["min_log_evidence"] == SETTINGS.min_log_evidence


def test_the_tables_of_settings_are_current() -> None:
    """Fails when a setting changed and docs/settings.md did not: run python -m validation.figures."""
    text = TABLE.read_text(encoding="utf-8")
    assert all(markdown_table(settings).strip() in text for settings in IN_FORCE.values())
