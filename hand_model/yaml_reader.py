"""Reading a YAML mapping key by key: every key is known, typed and range-checked; the rest is an error.

Errors are DescriptionError: one line with file, key, value and allowed range.
"""

from __future__ import annotations

import difflib
import re
import reprlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from hand_model.yaml_loader import DescriptionError, load_yaml

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


class Section:
    """A mapping of the file with known keys, laid over another one with defaults.

    Every method that reads a key raises DescriptionError where the value is missing, of another type or out of range.
    """

    def __init__(
        self, data: object, path: Path, where: str, known: Sequence[str], defaults: Section | None = None
    ) -> None:
        """Wrap data found at the dotted key `where` of file `path`; raises if it is no mapping of known keys."""
        if not isinstance(data, dict):
            raise DescriptionError(f"{path}: {where or 'the file'} is {_show(data)}; it must be a mapping")
        self._data: dict[str, Any] = data
        self._path = path
        self._where = where
        self._known = known
        self._defaults = defaults
        for key in data:
            if key not in known:
                near = difflib.get_close_matches(key, known, n=1)
                meant = f"did you mean {near[0]}? " if near else ""
                raise self.error(_show_key(key), f"is not a known key; {meant}known here: {', '.join(known)}")

    def error(self, key: str, problem: str) -> DescriptionError:
        """An error about a key of this section, named where the file has it."""
        if key not in self._data and self._defaults is not None and key in self._defaults:
            return self._defaults.error(key, problem)
        return DescriptionError(f"{self._path}: {self._name(key)} {problem}")

    def _name(self, key: str) -> str:
        return f"{self._where}.{key}" if self._where else key

    def __contains__(self, key: str) -> bool:
        return key in self._data or (self._defaults is not None and key in self._defaults)

    def raw(self, key: str, allowed: str, default: object = None) -> Any:
        """The value as YAML read it, or the default; raises if there is neither, saying what is allowed."""
        if key in self._data:
            return self._data[key]
        if self._defaults is not None and key in self._defaults:
            return self._defaults.raw(key, allowed)
        if default is None:
            raise self.error(key, f"is missing; it must be {allowed}")
        return default

    def number(self, key: str, low: float, high: float, default: float | None = None) -> float:
        """A finite number in low ... high, both included, in the unit of the key [as its name says]."""
        allowed = f"a number from {low:g} to {high:g}"
        value = self.raw(key, allowed, default)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(key, f"is {_show(value)}; it must be {allowed}")
        if not low <= value <= high:
            raise self.error(key, f"is {_show(value)}; the allowed range is {low:g} to {high:g}")
        return float(value)

    def integer(self, key: str, low: int, high: int, default: int | None = None) -> int:
        """A whole number in low ... high, both included."""
        allowed = f"a whole number from {low} to {high}" if low < high else str(low)
        value = self.raw(key, allowed, default)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise self.error(key, f"is {_show(value)}; it must be {allowed}")
        return value

    def numbers(self, key: str, count: int, default: list[float]) -> list[float]:
        """A list of finite numbers."""
        allowed = f"a list of {count} numbers from -1e12 to 1e12"
        value = self.raw(key, allowed, default)
        good = isinstance(value, list) and len(value) == count
        if not good or not all(type(k) in (int, float) and abs(k) <= 1e12 for k in value):
            raise self.error(key, f"is {_show(value)}; it must be {allowed}")
        return [float(k) for k in value]

    def name(self, key: str, default: str | None = None) -> str:
        """A name: a letter, then letters, digits and underscores."""
        value = self.raw(key, "a name", default)
        if value != default and not (isinstance(value, str) and _NAME.fullmatch(value)):
            raise self.error(key, f"is {_show(value)}; it must be a name of letters, digits and underscores")
        return str(value)

    def choice(self, key: str, allowed: list[str], default: str | None = None) -> str:
        """One of a few strings."""
        value = self.raw(key, f"one of {', '.join(allowed)}", default)
        if value != default and value not in allowed:
            raise self.error(key, f"is {_show(value)}; it must be one of {', '.join(allowed)}")
        return str(value)

    def section(self, key: str, known: Sequence[str], *, required: bool = True) -> Section:
        """A mapping below this one; empty where it is missing and not required."""
        defaults = None
        if self._defaults is not None and key in self._defaults:
            defaults = self._defaults.section(key, known)
        if key in self._data:
            data = self._data[key]
        elif defaults is not None or not required:
            data = {}
        else:
            raise self.error(key, f"is missing; it must be a mapping of {', '.join(known)}")
        return Section(data, self._path, self._name(key), known, defaults)

    def sections(self, key: str, known: Sequence[str]) -> Iterator[Section]:
        """The mappings of a list below this one; raises if the list is empty."""
        allowed = "a list with at least one entry"
        items = self.raw(key, allowed)
        if not isinstance(items, list) or not items:
            raise self.error(key, f"is {_show(items)}; it must be {allowed}")
        for index, item in enumerate(items):
            named = isinstance(item, dict) and isinstance(item.get("name"), str)
            label = _show_key(item["name"]) if named else index
            yield Section(item, self._path, f"{self._name(key)}[{label}]", known)

    def over(self, defaults: Section) -> Section:
        """This section laid over defaults, group by group."""
        return Section(self._data, self._path, self._where, self._known, defaults)


def is_name(text: str) -> bool:
    """Whether a text is a letter, then letters, digits and underscores."""
    return _NAME.fullmatch(text) is not None


def read_yaml(path: Path, known: Sequence[str]) -> Section:
    """The file's top mapping; one clear line for a missing, empty or broken file."""
    return Section(load_yaml(path), path, "", known)


def _show(value: object) -> str:
    """A value in short, on one line."""
    return "nothing" if value is None else reprlib.repr(value)


def _show_key(key: str) -> str:
    return key if _NAME.fullmatch(key) else reprlib.repr(key)


__all__ = ["DescriptionError", "Section", "is_name", "read_yaml"]
