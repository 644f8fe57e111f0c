"""The numbers of the diagnosis: all in one documented class, printed in every report, tabled in the documents."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from dataclasses import FrozenInstanceError, fields
from pathlib import Path

import pytest

from hand_diagnosis.diagnosis import Diagnosis
from hand_diagnosis.report import document
from hand_diagnosis.settings import SETTINGS, Settings
from hand_diagnosis.settings_table import markdown_table

ROOT = Path(__file__).resolve().parents[2]
TABLE = ROOT / "docs" / "settings.md"
BOUNDING = {"min", "max", "clip", "quantile", "minimum", "maximum", "isclose"}
LARGEST_STRUCTURAL, GUARD = 3, 1e-6


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


@pytest.mark.parametrize(
    "path", sorted((ROOT / "hand_diagnosis").rglob("*.py")), ids=lambda path: f"{path.parent.stem}/{path.stem}"
)
def test_every_deciding_number_is_a_setting(path: Path) -> None:
    """Fails when a module of the diagnosis has a threshold of its own instead of one of the settings."""
    if path.stem in {"settings", "fit_settings"}:
        assert len(re.findall(r"^class (?:Fit)?Settings\b", path.read_text(encoding="utf-8"), re.MULTILINE)) == 1
        return
    assert bare_numbers(path.read_text(encoding="utf-8")) == []


def test_every_setting_is_documented_and_used() -> None:
    """Fails when a setting lacks its unit, meaning, source or consequences, is unused, or can be changed in place."""
    sources = "\n".join(
        path.read_text(encoding="utf-8") for path in (ROOT / "hand_diagnosis").rglob("*.py") if path.stem != "settings"
    )
    for entry in fields(Settings):
        about = entry.metadata
        assert all(about[key] for key in ("unit", "meaning", "source", "halved", "doubled")), entry.name
        assert f"SETTINGS.{entry.name}" in sources, f"{entry.name} is used nowhere"
    with pytest.raises(FrozenInstanceError):
        SETTINGS.max_effects = 5  # type: ignore[misc]
    with pytest.raises(TypeError):
        Settings(1.0)  # type: ignore[misc]


def test_the_report_prints_every_setting() -> None:
    """Fails when a report does not say with which settings it was made."""
    report = document(Diagnosis("agrees", (), (), (), (), (), False), [], "hand.yaml")
    printed = json.loads(json.dumps(report["settings"], allow_nan=False))
    assert set(printed) == {entry.name for entry in fields(Settings)}
    assert printed["min_log_evidence"] == SETTINGS.min_log_evidence


def test_the_table_of_settings_is_current() -> None:
    """Fails when a setting changed and docs/settings.md did not: run python -m validation.figures."""
    text = TABLE.read_text(encoding="utf-8")
    assert markdown_table().strip() in text
