"""Reading a YAML mapping key by key: every key is asked for, typed and range-checked; the rest is an error.

Errors are DescriptionError: one line with file, key, value and allowed range.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml


class DescriptionError(ValueError):
    """A YAML file is not what it should be; the message is one line."""


class _Loader(yaml.SafeLoader):
    """Safe loader that refuses a key written twice and reads 1e5 as a number, as YAML 1.2 does."""


def _mapping(loader: _Loader, node: yaml.MappingNode) -> dict[Any, Any]:
    seen: set[Any] = set()
    for key_node, _ in node.value:
        key = loader.construct_object(key_node)  # type: ignore[no-untyped-call]
        if key in seen:
            raise yaml.MarkedYAMLError(problem=f"key {key!r} is there twice", problem_mark=key_node.start_mark)
        seen.add(key)
    return dict(loader.construct_pairs(node, deep=True))  # type: ignore[no-untyped-call]


_Loader.add_constructor("tag:yaml.org,2002:map", _mapping)


class Section:
    """A mapping of the file, read once; `done` refuses keys nobody asked for."""

    def __init__(self, data: object, path: Path, where: str) -> None:
        """Wrap data found at the dotted key `where` of file `path`; raises if it is no mapping."""
        if not isinstance(data, dict):
            raise DescriptionError(f"{path}: {where or 'the file'} must be a mapping, not {_show(data)}")
        self._data = data
        self._path = path
        self._where = where
        self._asked: set[str] = set()

    def error(self, key: str, problem: str) -> DescriptionError:
        """An error about a key of this section."""
        return DescriptionError(f"{self._path}: {self._name(key)} {problem}")

    def _name(self, key: str) -> str:
        return f"{self._where}.{key}" if self._where else key

    def __contains__(self, key: str) -> bool:
        return key in self._data

    def raw(self, key: str, default: object = None, *, required: bool = True) -> Any:
        """The value as YAML read it."""
        self._asked.add(key)
        if key not in self._data:
            if required and default is None:
                raise self.error(key, "is missing")
            return default
        return self._data[key]

    def number(self, key: str, low: float, high: float, default: float | None = None) -> float:
        """A finite number in low ... high, both included."""
        value = self.raw(key, default)
        if isinstance(value, str):
            value = _as_float(value)
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise self.error(key, f"is {_show(value)}; it must be a number from {low:g} to {high:g}")
        if not low <= value <= high:
            raise self.error(key, f"is {value:g}; the allowed range is {low:g} to {high:g}")
        return float(value)

    def integer(self, key: str, low: int, high: int, default: int | None = None) -> int:
        """A whole number in low ... high, both included."""
        value = self.raw(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise self.error(key, f"is {_show(value)}; it must be a whole number from {low} to {high}")
        return value

    def text(self, key: str, default: str | None = None) -> str:
        """A string."""
        value = self.raw(key, default)
        if not isinstance(value, str):
            raise self.error(key, f"is {_show(value)}; it must be text")
        return value

    def choice(self, key: str, allowed: tuple[str, ...], default: str | None = None) -> str:
        """One of a few strings."""
        value = self.text(key, default)
        if value not in allowed:
            raise self.error(key, f"is {value!r}; it must be one of {', '.join(allowed)}")
        return value

    def section(self, key: str, *, required: bool = True) -> Section:
        """A mapping below this one; empty where it is missing and not required."""
        return Section(self.raw(key, {}, required=required), self._path, self._name(key))

    def sections(self, key: str) -> Iterator[Section]:
        """The mappings of a list below this one; raises if the list is empty."""
        items = self.raw(key)
        if not isinstance(items, list) or not items:
            raise self.error(key, "must be a list with at least one entry")
        for index, item in enumerate(items):
            label = item["name"] if isinstance(item, dict) and "name" in item else str(index)
            yield Section(item, self._path, f"{self._name(key)}[{label}]")

    def keys(self) -> list[str]:
        """Every key of the mapping, as text."""
        return [str(key) for key in self._data]

    def merged(self, defaults: Section) -> Section:
        """This section laid over defaults, group by group."""
        return Section(_merge(defaults._data, self._data), self._path, self._where)

    def done(self) -> None:
        """Raise if the mapping has a key that was never asked for."""
        unknown = [str(key) for key in self._data if key not in self._asked]
        if unknown:
            known = ", ".join(sorted(self._asked))
            raise self.error(unknown[0], f"is not a known key; known here: {known}")


def read_yaml(path: Path) -> Section:
    """The file's top mapping; one clear line for a missing, empty or broken file."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise DescriptionError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise DescriptionError(f"{path}: is not UTF-8 text") from None
    try:
        data = yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else "?"
        raise DescriptionError(f"{path}: line {line}: {error.problem}") from None
    except yaml.YAMLError as error:
        raise DescriptionError(f"{path}: is not YAML: {' '.join(str(error).split())}") from None
    if data is None:
        raise DescriptionError(f"{path}: is empty")
    return Section(data, path, "")


def _merge(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    merged = dict(below)
    for key, value in above.items():
        base = merged.get(key)
        merged[key] = _merge(base, value) if isinstance(base, dict) and isinstance(value, dict) else value
    return merged


def _as_float(text: str) -> float | str:
    # YAML 1.1 reads 1e5 (no dot) as text; people mean the number.
    try:
        return float(text)
    except ValueError:
        return text


def _show(value: object) -> str:
    return "nothing" if value is None else repr(value)
