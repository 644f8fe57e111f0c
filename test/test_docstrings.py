"""Public functions: docstrings state shapes, units and errors, and signatures stay short."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
COMPLYING = (
    "hand_client",
    "hand_control",
    "hand_diagnosis",
    "hand_driver",
    "hand_identification",
    "hand_machine",
    "hand_messages",
    "hand_model",
    "hand_pages",
    "hand_recording",
    "hand_robot",
    "hand_ros",
    "hand_sim",
    "hand_studio",
    "hand_tool",
    "validation",
)
"""Packages whose public functions are checked: all."""
MOST_POSITIONAL = 6
FROZEN = json.loads((ROOT / "validation" / "referees" / "frozen.json").read_text(encoding="utf-8"))
ARRAY = re.compile(r"\b(Array|Flags|NDArray|ndarray)\b")
FLOATS = re.compile(r"\b(Array|ndarray|NDArray\[np\.float64\])\b(?!.*\bFlags\b)")
AXIS = r"(?:\.\.\.|\w+)(?: (?:[-+*/]|of) \w+)?"
SHAPE = re.compile(rf"\({AXIS}(?:,|(?:, {AXIS})+,?)\)")
UNIT = re.compile(r"\[[^\]]+\]|\bSI\b")
UNIT_SUFFIX = re.compile(r"_(s|rad|deg|pa|hz|m|n|nm|kg|bar|v|rad_s|rad_s2|pa_s|m2|m3|ohm|per_hour)$")


@dataclass(frozen=True, slots=True)
class Function:
    """A public function or method: where it is, its node, and its docstring with that of its class."""

    where: str
    node: ast.FunctionDef
    text: str

    @property
    def arguments(self) -> list[ast.arg]:
        every = self.node.args
        return [a for a in (*every.posonlyargs, *every.args, *every.kwonlyargs) if a.arg not in {"self", "cls"}]

    @property
    def is_compiled(self) -> bool:
        return any(
            re.search(r"\b(njit|inlined?|compiled|without_arrays|_equation)\b", ast.unparse(each))
            for each in self.node.decorator_list
        )

    @property
    def positional(self) -> list[ast.arg]:
        every = self.node.args
        return [a for a in (*every.posonlyargs, *every.args) if a.arg not in {"self", "cls"}]


def files(names: tuple[str, ...] = COMPLYING) -> list[Path]:
    found: list[Path] = []
    for name in names:
        path = ROOT / name
        found += [path] if path.suffix == ".py" else sorted(path.glob("**/*.py"))
    return found


@cache
def parsed(path: Path) -> ast.Module:
    """The tree of a module, parsed once."""
    return ast.parse(path.read_text(encoding="utf-8"))


def public_functions(path: Path) -> Iterator[Function]:
    """Module functions and methods of public classes whose names have no leading underscore."""
    tree = parsed(path)
    where = path.relative_to(ROOT) if path.is_relative_to(ROOT) else path.name
    owners = [("", tree.body, "")]
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef) and not node.name.startswith("_")]
    owners += [(f"{node.name}.", node.body, ast.get_docstring(node) or "") for node in classes]
    for prefix, body, above in owners:
        for node in body:
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                text = f"{ast.get_docstring(node) or ''}\n{above}"
                yield Function(f"{where}:{node.lineno} {prefix}{node.name}", node, text)


def faults(function: Function) -> Iterator[str]:
    """What a docstring lacks."""
    annotations = {a.arg: ast.unparse(a.annotation) if a.annotation else "" for a in function.arguments}
    arrays = [name for name, annotation in annotations.items() if ARRAY.search(annotation)]
    if arrays and not SHAPE.search(function.text):
        yield f"no shape of {', '.join(arrays)}"
    returned = ast.unparse(function.node.returns) if function.node.returns else ""
    if ARRAY.search(returned) and not SHAPE.search(function.text):
        yield "no shape of what it returns"
    scalars = [name for name, annotation in annotations.items() if re.fullmatch(r"float( \| None)?", annotation)]
    numbers = [name for name, annotation in annotations.items() if FLOATS.search(annotation)]
    bare = [name for name in (*scalars, *numbers) if not UNIT_SUFFIX.search(name)]
    if bare and not function.is_compiled and not UNIT.search(function.text):
        yield f"no unit of {', '.join(bare)}"
    gives = re.fullmatch(r"(Array|float)( \| None)?", returned) and not UNIT_SUFFIX.search(function.node.name)
    if gives and not function.is_compiled and not UNIT.search(function.text):
        yield "no unit of what it returns"


def raised(function: Function) -> set[str]:
    """What the body of a function raises itself, but for what it handles: names of exceptions, or of their makers."""
    found: set[str] = set()
    _collect(function.node, found, set())
    return found


def _collect(node: ast.AST, found: set[str], handled: set[str]) -> None:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.Lambda | ast.ClassDef):
            continue
        if isinstance(child, ast.With) and any("running(" in ast.unparse(item) for item in child.items):
            continue  # a subcommand, whose errors become a line and an exit code
        if isinstance(child, ast.Raise) and child.exc is not None:
            made = child.exc.func if isinstance(child.exc, ast.Call) else child.exc
            found |= {ast.unparse(made).rpartition(".")[2]} - handled
        if isinstance(child, ast.Try):
            types = " ".join(ast.unparse(handler.type) for handler in child.handlers if handler.type)
            _collect(ast.Module(child.body, []), found, handled | set(re.findall(r"\w+", types)))
            for handler in child.handlers:
                _collect(handler, found, handled)
            _collect(ast.Module([*child.orelse, *child.finalbody], []), found, handled)
            continue
        _collect(child, found, handled)


def states(function: Function, errors: set[str]) -> bool:
    """Whether a docstring says what is raised, lists the exit codes of a command, or refers to one that does."""
    return bool(re.search(r"\b[Rr]aises?\b|^Exit codes|^See [\w.]+\.$", function.text, re.MULTILINE)) or any(
        re.search(rf"\b{error}\b", function.text) for error in errors - {"error"}
    )


def test_the_walk_sees_what_is_missing(tmp_path: Path) -> None:
    """Fails when a docstring without shape or unit passes, or a complete one does not."""
    source = (
        'def a(x: Array, y: float) -> None:\n    """Nothing (really)."""\n'
        'def b(x: Array, y: float, z_s: float) -> None:\n    """x: (T, joints).  y: [N m]."""\n'
        'def c(z_s: float) -> Array:\n    """A sum, SI."""\n'
        'def d(x: Array) -> float:\n    """x: (T,)."""\n'
    )
    (tmp_path / "module.py").write_text(source, encoding="utf-8")
    found = {f.node.name: list(faults(f)) for f in public_functions(tmp_path / "module.py")}
    assert found == {
        "a": ["no shape of x", "no unit of y, x"],
        "b": [],
        "c": ["no shape of what it returns"],
        "d": ["no unit of x", "no unit of what it returns"],
    }


@pytest.mark.parametrize("path", files(), ids=lambda path: str(path.relative_to(ROOT)))
def test_docstrings_state_shapes_and_units(path: Path) -> None:
    """Fails when a public function takes or returns an array without its shape, or a number without its unit."""
    missing = {function.where: lacking for function in public_functions(path) if (lacking := list(faults(function)))}
    if path.parent.name == "referees" and path.name in FROZEN:  # a frozen file keeps every character
        missing = {where: lacks for where, lacks in missing.items() if lacks != ["no unit of what it returns"]}
    assert not missing


def test_the_walk_sees_errors(tmp_path: Path) -> None:
    """Fails when an error that a docstring does not name passes, or one that is named, handled or printed does not."""
    source = (
        'def a():\n    """A."""\n    if 1:\n        raise ValueError("x")\n'
        'def b():\n    """B. Raises ValueError for x."""\n    raise ValueError("x")\n'
        'def c():\n    """C."""\n    try:\n        raise ValueError\n    except (OSError, ValueError):\n        pass\n'
        'def d():\n    """D."""\n    with running():\n        raise ValueError("x")\n'
        'def e():\n    """E."""\n    try:\n        f()\n    except OSError:\n        raise ValueError("x") from None\n'
    )
    (tmp_path / "module.py").write_text(source, encoding="utf-8")
    walked = {f.node.name: raised(f) for f in public_functions(tmp_path / "module.py") if not states(f, raised(f))}
    assert {name for name, errors in walked.items() if errors} == {"a", "e"}


@pytest.mark.parametrize("path", files(), ids=lambda path: str(path.relative_to(ROOT)))
def test_docstrings_state_errors(path: Path) -> None:
    """Fails when a public function raises an error itself and its docstring does not say so."""
    silent = {f.where: errors for f in public_functions(path) if (errors := raised(f)) and not states(f, errors)}
    assert not silent


@pytest.mark.parametrize("path", files(), ids=lambda path: str(path.relative_to(ROOT)))
def test_every_public_function_has_a_docstring(path: Path) -> None:
    """Fails when a public function has no docstring."""
    assert not [function.where for function in public_functions(path) if not ast.get_docstring(function.node)]


@pytest.mark.parametrize("path", files(), ids=lambda path: str(path.relative_to(ROOT)))
def test_signatures_are_short(path: Path) -> None:
    """Fails when a public function that is not a compiled term takes more than six positional arguments."""
    plain = [function for function in public_functions(path) if not function.is_compiled]
    long = {f.where: len(f.positional) for f in plain if len(f.positional) > MOST_POSITIONAL}
    assert not long


KEPT = {"Parameter", "Frame", "SamplePayload", "Reproduction", "Trial", "FaultResult"}
"""Records that are written as rows of a table, or unpacked from bytes."""


def many_positional(tree: ast.Module, classes: set[str]) -> list[tuple[int, str]]:
    """Line and name of calls of classes with more than MOST_POSITIONAL arguments that are not named."""
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    named = [(call, ast.unparse(call.func).rpartition(".")[2]) for call in calls if len(call.args) > MOST_POSITIONAL]
    return [(call.lineno, name) for call, name in named if name in classes]


def dataclasses_of(tree: ast.Module) -> set[str]:
    """Names of the dataclasses of a module that have more than MOST_POSITIONAL fields, or inherit some."""
    classes = [node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    classes = [node for node in classes if "dataclass" in " ".join(map(ast.unparse, node.decorator_list))]
    counts = {node.name: sum(isinstance(part, ast.AnnAssign) for part in node.body) for node in classes}
    return {node.name for node in classes if node.bases or counts[node.name] > MOST_POSITIONAL}


def test_fields_are_named() -> None:
    """Fails when a dataclass gets more than six fields by their order, in which two can be exchanged unnoticed."""
    trees = {path: parsed(path) for path in files((*COMPLYING, "test", "examples"))}
    classes = {name for tree in trees.values() for name in dataclasses_of(tree)}
    assert classes >= KEPT
    found = {str(path.relative_to(ROOT)): many_positional(tree, classes - KEPT) for path, tree in trees.items()}
    assert {path: calls for path, calls in found.items() if calls} == {}


def test_seven_fields_by_order_are_seen() -> None:
    """Fails when the search overlooks a call with seven fields by their order, or finds one with names."""
    fields = "".join(f"    {name}: int\n" for name in "abcdefg")
    calls = "x = m.A(1, 2, 3, 4, 5, 6, 7)\ny = A(1, 2, 3, 4, 5, 6, g=7)\n"
    tree = ast.parse(f"{calls}@dataclass(frozen=True)\nclass A:\n{fields}@dataclass\nclass B:\n    a: int\n")
    assert dataclasses_of(tree) == {"A"}
    assert many_positional(tree, {"A"}) == [(1, "A")]
