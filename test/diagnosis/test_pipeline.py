"""The way from a recording to a sentence of the report: a line of modules, each importing only earlier ones.

A module is a file, or a folder that other code uses through its `__init__.py` alone.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ARCHITECTURE = ROOT / "docs" / "architecture.md"
HEADING = "## From a recording to a sentence"
LONGEST = 9
PACKAGE = "hand_diagnosis"
SETTINGS_MODULES = ("settings", "settings_table", "fit_settings", "law_settings", "page_settings")
SETTINGS = {f"{PACKAGE}/{name}.py" for name in SETTINGS_MODULES}
OTHERS = {
    f"{PACKAGE}/{name}"
    for name in (
        "__init__.py",
        "api.py",
        "detection.py",
        "fleet.py",
        "found_machine.py",
        "machine_report.py",
        "pages",
        "patch.py",
        "prediction.py",
    )
}
"""What shows or repeats the report, or stands next to it."""
OUTSIDE = [
    path
    for folder in (PACKAGE, "hand_tool", "hand_studio", "validation", "examples")
    for path in sorted((ROOT / folder).rglob("*.py"))
]
"""Code that uses the diagnosis; a test may look into a module."""


def section() -> str:
    """The section of the architecture page."""
    text = ARCHITECTURE.read_text(encoding="utf-8")
    begin = text.index(HEADING) + len(HEADING)
    end = text.find("\n## ", begin)
    return text[begin : end if end >= 0 else len(text)]


def documented() -> list[str]:
    """Modules in the order in which the page lists them, such as hand_diagnosis/search."""
    return re.findall(r"^\d+\. `([a-z_]+/[a-z_]+(?:\.py)?)`", section(), re.MULTILINE)


def rooms() -> set[str]:
    """The folders of the diagnosis that are modules of the way."""
    return {module for module in documented() if module.startswith(PACKAGE) and not module.endswith(".py")}


def module_of(name: str) -> str:
    """The file or folder, such as hand_diagnosis/search, of an imported name, such as hand_diagnosis.search.laws."""
    first = name.split(".")[1]
    return f"{PACKAGE}/{first}" if (ROOT / PACKAGE / first).is_dir() else f"{PACKAGE}/{first}.py"


def imported(path: Path) -> set[str]:
    """Dotted names of modules of the diagnosis that a file imports anywhere."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module == PACKAGE:
            names = {f"{PACKAGE}.{alias.name}" for alias in node.names}
            found |= {name for name in names if (ROOT / module_of(name)).exists()}
        elif isinstance(node, ast.ImportFrom) and node.module and node.module.startswith(f"{PACKAGE}."):
            found.add(node.module)
    return found


def files_of(module: str) -> list[Path]:
    """The file of a module, or the files of a folder."""
    place = ROOT / module
    return sorted(place.glob("*.py")) if place.is_dir() else [place]


def imports(module: str) -> set[str]:
    """The other modules of the diagnosis that a module uses; its settings are everywhere."""
    names = {name for path in files_of(module) for name in imported(path)}
    return {module_of(name) for name in names} - SETTINGS - {module}


def test_the_way_is_short() -> None:
    """Fails when the way gets longer than LONGEST modules, or the page and the code differ about it."""
    way = documented()
    assert 1 < len(way) <= LONGEST
    assert all((ROOT / module).exists() for module in way), way
    reached, waiting = set[str](), [f"{PACKAGE}/report.py"]
    while waiting:
        module = waiting.pop()
        if module not in reached:
            reached.add(module)
            waiting += sorted(imports(module))
    assert reached == {module for module in way if module.startswith(PACKAGE)}


@pytest.mark.parametrize("module", documented())
def test_no_module_imports_a_later_one(module: str) -> None:
    """Fails when a module of the way climbs back: it imports a later one."""
    way = documented()
    assert imports(module) <= set(way[: way.index(module)])


@pytest.mark.parametrize("room", sorted(rooms()))
def test_no_file_of_a_room_imports_in_a_circle(room: str) -> None:
    """Fails when two files of a folder import each other, directly or by way of others."""
    inside = {
        path.stem: {name.split(".")[2] for name in imported(path) if name.count(".") == 2 and module_of(name) == room}
        for path in files_of(room)
        if path.stem != "__init__"
    }
    while inside:
        lowest = {name for name, below in inside.items() if not below & inside.keys()}
        assert lowest, f"a circle among {sorted(inside)}"
        inside = {name: below for name, below in inside.items() if name not in lowest}


@pytest.mark.parametrize("path", OUTSIDE, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_folder_is_used_through_its_interface(path: Path) -> None:
    """Fails when a file reaches past the `__init__.py` of a folder of the way that it is not in."""
    for name in imported(path):
        room = module_of(name)
        if room in rooms() and path.parent != ROOT / room:
            assert name.count(".") == 1, f"{name}: import from {room.replace('/', '.')}"


def test_what_shows_the_report_is_not_on_the_way() -> None:
    """Fails when a module of the diagnosis belongs neither to the way nor to what shows or repeats it."""
    places = [
        place for place in (ROOT / PACKAGE).iterdir() if place.suffix == ".py" or (place / "__init__.py").is_file()
    ]
    others = {f"{PACKAGE}/{place.name}" for place in places} - set(documented()) - SETTINGS
    assert others == OTHERS


def test_modules_stay_short() -> None:
    """Fails when a file of the diagnosis reaches 400 lines."""
    for path in (ROOT / PACKAGE).rglob("*.py"):
        assert len(path.read_text(encoding="utf-8").splitlines()) < 400, path.name
