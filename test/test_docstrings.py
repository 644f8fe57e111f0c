"""Public functions: docstrings state shapes and units, and signatures stay short."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
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
    "hand_ros",
    "hand_sim",
    "hand_studio",
    "hand_tool",
    "validation",
)
"""Packages whose public functions are checked: all."""
MOST_POSITIONAL = 6
ARRAY = re.compile(r"\b(Array|Flags|NDArray|ndarray)\b")
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
            re.search(r"\b(njit|inline|compiled|without_arrays|_equation)\b", ast.unparse(each))
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


def public_functions(path: Path) -> Iterator[Function]:
    """Module functions and methods of public classes whose names have no leading underscore."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
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
    bare = [name for name in scalars if not UNIT_SUFFIX.search(name)]
    if bare and not UNIT.search(function.text):
        yield f"no unit of {', '.join(bare)}"


def test_the_walk_sees_what_is_missing(tmp_path: Path) -> None:
    """Fails when a docstring without shape or unit passes, or a complete one does not."""
    source = (
        'def a(x: Array, y: float) -> None:\n    """Nothing (really)."""\n'
        'def b(x: Array, y: float, z_s: float) -> None:\n    """x: (T, joints).  y: [N m]."""\n'
        'def c(z_s: float) -> Array:\n    """A sum."""\n'
    )
    (tmp_path / "module.py").write_text(source, encoding="utf-8")
    found = {f.node.name: list(faults(f)) for f in public_functions(tmp_path / "module.py")}
    assert found == {"a": ["no shape of x", "no unit of y"], "b": [], "c": ["no shape of what it returns"]}


@pytest.mark.parametrize("path", files(), ids=lambda path: str(path.relative_to(ROOT)))
def test_docstrings_state_shapes_and_units(path: Path) -> None:
    """Fails when a public function takes or returns an array without its shape, or a number without its unit."""
    missing = {function.where: lacking for function in public_functions(path) if (lacking := list(faults(function)))}
    assert not missing


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
