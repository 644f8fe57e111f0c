"""The way from a recording to a sentence of the report: a line of modules, each importing only earlier ones."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ARCHITECTURE = ROOT / "docs" / "architecture.md"
HEADING = "## From a recording to a sentence"
LONGEST = 16
PACKAGE = "hand_diagnosis"
OTHERS = (
    "__init__",
    "api",
    "compare",
    "detection",
    "drawing",
    "figures",
    "fit_settings",
    "fleet",
    "fleet_page",
    "found_machine",
    "headline",
    "page",
    "page_plots",
    "patch",
    "prediction",
    "prediction_page",
    "settings",
    "settings_table",
)
"""What shows or repeats the report, or stands next to it."""


def section() -> str:
    """The section of the architecture page."""
    text = ARCHITECTURE.read_text(encoding="utf-8")
    begin = text.index(HEADING) + len(HEADING)
    end = text.find("\n## ", begin)
    return text[begin : end if end >= 0 else len(text)]


def documented() -> list[str]:
    """Modules in the order in which the page lists them, such as hand_diagnosis/task.py."""
    return re.findall(r"^\d+\. `([a-z_]+/[a-z_]+\.py)`", section(), re.MULTILINE)


def imports(module: str) -> set[str]:
    """Modules of the diagnosis, as paths, that a module imports anywhere in its file."""
    found = set()
    for node in ast.walk(ast.parse((ROOT / module).read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module == PACKAGE:
            found |= {f"{PACKAGE}/{alias.name}.py" for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.module.startswith(f"{PACKAGE}."):
            found.add(f"{node.module.replace('.', '/')}.py")
    return found - {f"{PACKAGE}/{name}.py" for name in ("settings", "settings_table", "fit_settings")}


def test_the_way_is_short() -> None:
    """Fails when the way gets longer than LONGEST modules, or the page and the code differ about it."""
    way = documented()
    assert 1 < len(way) <= LONGEST
    assert all((ROOT / module).is_file() for module in way), way
    reached, waiting = set[str](), [f"{PACKAGE}/report.py"]
    while waiting:
        module = waiting.pop()
        if module not in reached:
            reached.add(module)
            waiting += sorted(imports(module))
    assert reached == {module for module in way if module.startswith(PACKAGE)}


@pytest.mark.parametrize("module", documented())
def test_no_module_imports_a_later_one(module: str) -> None:
    """Fails when a module of the way climbs back: it imports itself or a later one."""
    way = documented()
    assert imports(module) <= set(way[: way.index(module)])


def test_what_shows_the_report_is_not_on_the_way() -> None:
    """Fails when a module of the diagnosis belongs neither to the way nor to what shows or repeats it."""
    way = set(documented())
    others = {f"{PACKAGE}/{path.name}" for path in (ROOT / PACKAGE).glob("*.py")} - way
    assert others == {f"{PACKAGE}/{name}.py" for name in OTHERS}


def test_modules_stay_short() -> None:
    """Fails when a file of the diagnosis reaches 400 lines."""
    for path in (ROOT / PACKAGE).glob("*.py"):
        assert len(path.read_text(encoding="utf-8").splitlines()) < 400, path.name
