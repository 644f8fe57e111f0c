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
UNITS = {100.0, 180.0, 1e3, 1e5, 1e-5, 1e9, 86400.0}
"""Ratios of units."""
ORDERS = {5, 6, 0.6745, 1.5, 20.0}
"""Points and orders of polynomials and differences below the diagnosis, the share of white noise that they leave, and
the quartile of a normal distribution."""
HALVES = {
    *("certificate", "detection", "evidence", "experiments", "laws", "onset", "stage_errors"),  # of a log likelihood
    *("driving", "page_plots"),  # mean of two neighbours
    *("hand_signals", "sample_clock", "signals"),  # median, second difference, and the middle of a window
}
"""Modules in which a half is part of a formula."""


def is_structural(value: float) -> bool:
    """Small integers and guards against division by zero decide nothing about a recording."""
    if isinstance(value, int) or float(value).is_integer():
        return abs(value) <= LARGEST_STRUCTURAL
    return abs(value) <= GUARD


def plain(part: ast.expr) -> float | None:
    """The value of a number, with its sign."""
    inner = part.operand if isinstance(part, ast.UnaryOp) else part
    is_number = isinstance(inner, ast.Constant) and type(inner.value) in {int, float}
    return inner.value if is_number else None  # type: ignore[attr-defined]


def factors(tree: ast.Module) -> Iterator[tuple[int, float]]:
    """Line and value of numbers that something is multiplied with or divided by, 1 and 2 left out."""
    for node in ast.walk(tree):
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div | ast.FloorDiv):
            values = [plain(side) for side in (node.left, node.right)]
            yield from ((node.lineno, v) for v in values if v is not None and abs(v) > GUARD and v not in {1, 2})


def arguments(tree: ast.Module) -> Iterator[tuple[int, float]]:
    """Line and value of fractions and large numbers that are handed to functions."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            values = [plain(each) for each in (*node.args, *(k.value for k in node.keywords))]
            yield from ((node.lineno, v) for v in values if isinstance(v, float) and not is_structural(v))


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


def bare_numbers(source: str, *, drawn: bool = False) -> list[tuple[int, float]]:
    """Line and value of every number that decides something and is not structural.

    drawn: of a page, on which numbers that are handed to functions are sizes of drawings.
    """
    tree = ast.parse(source)
    found = {*factors(tree), *(() if drawn else arguments(tree))}
    for part in deciding_parts(tree):
        for node in ast.walk(part):
            if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
                found |= set() if is_structural(node.value) else {(node.lineno, node.value)}
    return sorted(found)


@pytest.mark.parametrize(
    "source",
    [
        *("LIMIT = 0.3", "class A:\n    limit: float = 7.0", "def f(x, y=25): ...", "if x > 0.95: ...", "min(x, 12)"),
        *("if x < 0.5 * y: ...", "y = 0.7 * x", "y = -3 * x", "y = x / 4.0", "y = x // 3", "f(x, 0.5)", "f(x, y=0.25)"),
    ],
)
def test_a_bare_number_is_seen(source: str) -> None:
    """Fails when the walk of the next test overlooks a kind of number."""
    assert bare_numbers(source)


@pytest.mark.parametrize("path", WAY, ids=lambda path: f"{path.parent.stem}/{path.stem}")
def test_every_deciding_number_is_a_setting(path: Path) -> None:
    """Fails when a module on the way to a report has a threshold of its own instead of one of the settings."""
    if path.stem in {"settings", "fit_settings", "law_settings", "page_settings"}:
        source = path.read_text(encoding="utf-8")
        assert len(re.findall(r"^class (?:Fit|Law|Page)?Settings\b", source, re.MULTILINE)) == 1
        return
    known = UNITS | (set() if path.is_relative_to(ROOT / "hand_diagnosis") else ORDERS)
    known |= {0.5} if path.stem in HALVES else set()
    found = bare_numbers(path.read_text(encoding="utf-8"), drawn=path.parent.name == "pages")
    assert [number for number in found if abs(number[1]) not in known] == []


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
    report = document(
        Diagnosis(verdict="agrees", findings=(), remainder=(), not_judged=(), joints=(), check=(), sensor_curve=False),
        [],
        "hand.yaml",
    )
    for key, settings in IN_FORCE.items():
        printed = json.loads(json.dumps(report[key], allow_nan=False))
        assert set(printed) == {entry.name for entry in fields(settings)}
    assert report["settings"]["min_log_evidence"] == SETTINGS.min_log_evidence


def test_the_tables_of_settings_are_current() -> None:
    """Fails when a setting changed and docs/settings.md did not: run python -m validation.figures."""
    text = TABLE.read_text(encoding="utf-8")
    assert all(markdown_table(settings).strip() in text for settings in IN_FORCE.values())
