"""docs/python.md: the reference of the Python interface of the diagnosis, from its signatures and docstrings."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from typing import Any

import hand_diagnosis
from hand_diagnosis import api


def markdown() -> str:
    """A section for each name of `hand_diagnosis.__all__`: its signature, text, and what a class offers."""
    return "\n\n".join(part for name in hand_diagnosis.__all__ for part in _section(name, getattr(api, name)))


def _section(name: str, what: Any) -> Iterator[str]:
    yield f"### `{name}`"
    if not inspect.isclass(what):
        yield _call(name, what)
        yield _text(what)
        return
    yield _text(what)
    members = [(key, value) for key, value in vars(what).items() if not key.startswith("_")]
    rows = [
        f"| `{key}` | `{_type(value.fget)}` | {_text(value).replace(chr(10), ' ')} |"
        for key, value in members
        if isinstance(value, property)
    ]
    yield "\n".join(["| attribute | type | meaning |", "|---|---|---|", *rows])
    for key, value in members:
        if inspect.isfunction(value):
            yield f"#### `{name}.{key}`"
            yield _call(key, value)
            yield _text(value)


def _call(name: str, function: Callable[..., Any]) -> str:
    """The signature as code, one parameter a line."""
    signature = inspect.signature(function)
    lines = [f"    {name}("]
    keyword_only = False
    for parameter in signature.parameters.values():
        if parameter.name == "self":
            continue
        if parameter.kind is parameter.KEYWORD_ONLY and not keyword_only:
            lines.append("        *,")
            keyword_only = True
        lines.append(f"        {_parameter(parameter)},")
    return "\n".join([*lines, f"    ) -> {signature.return_annotation}"]).replace("'", "")


def _parameter(parameter: inspect.Parameter) -> str:
    """A parameter with its type and default; a function as default has no text that stays the same."""
    if inspect.isfunction(parameter.default):
        return f"{parameter.replace(default=inspect.Parameter.empty)} = ..."
    return str(parameter)


def _type(function: Callable[..., Any] | None) -> str:
    return "" if function is None else str(inspect.signature(function).return_annotation).replace("|", "or")


def _text(what: Any) -> str:
    return inspect.cleandoc(what.__doc__ or "").replace("{", "&#123;")
