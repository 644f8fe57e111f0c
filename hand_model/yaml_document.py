"""Writing YAML: plain data as a text, and changes to a user's file that leave its comments and its order alone.

Reading with checks is in yaml_loader.py and yaml_reader.py; both read YAML 1.2, which ruamel.yaml writes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, MutableMapping, Sequence
from io import StringIO
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.constructor import RoundTripConstructor
from ruamel.yaml.nodes import ScalarNode
from ruamel.yaml.representer import RoundTripRepresenter

WIDTH = 120
DIGITS = 6
"""Significant digits of a number whose standard deviation is not known."""
FLOW_KEYS = 3
"""A new group of up to so many keys is written on one line."""


class _Number(float):
    """A number with the text that stands, or shall stand, in the file."""

    text: str

    def __new__(cls, text: str) -> _Number:
        number = super().__new__(cls, text)
        number.text = text
        return number


class _Constructor(RoundTripConstructor):
    """Keeps the text of every floating-point number, so that a number that is not changed stays as it was written."""

    def construct_yaml_float(self, node: ScalarNode) -> Any:
        """See class."""
        return super().construct_yaml_float(node) if "n" in node.value.lower() else _Number(node.value)


class _Representer(RoundTripRepresenter):
    """Writes the text of _Number, and nothing by reference: rosbag2 and people read repeated parts in full."""

    def ignore_aliases(self, data: Any) -> bool:
        """See class."""
        return True

    def represent_number(self, data: _Number) -> Any:
        """See class."""
        return self.represent_scalar("tag:yaml.org,2002:float", data.text)

    def represent_float(self, data: float) -> Any:
        """A number of plain data; one that is not finite as YAML spells it."""
        if not math.isfinite(data):
            return super().represent_float(data)
        return self.represent_scalar("tag:yaml.org,2002:float", _float_text(data))


_Constructor.add_constructor("tag:yaml.org,2002:float", _Constructor.construct_yaml_float)
_Representer.add_representer(_Number, _Representer.represent_number)
_Representer.add_representer(float, _Representer.represent_float)


def _yaml() -> YAML:
    yaml = YAML()
    yaml.Constructor, yaml.Representer = _Constructor, _Representer
    yaml.preserve_quotes = True
    yaml.width = WIDTH
    return yaml


def yaml_text(data: Mapping[str, Any] | Sequence[Any]) -> str:
    """Plain data (mappings, lists, text, numbers, None) as YAML in block style."""
    stream = StringIO()
    _yaml().dump(data, stream)
    return stream.getvalue()


def number_text(value: float, resolution: float = math.nan) -> str:
    """A number rounded to a tenth of its resolution, as YAML 1.1 and 1.2 read it.

    value, resolution: in the same unit [any].  resolution: the standard deviation of the number while all others keep
    their values; the rounding then changes no prediction noticeably. Where it is not known (NaN) or 0, DIGITS
    significant digits are written.
    """
    digits = DIGITS
    if value != 0.0 and resolution > 0.0 and math.isfinite(resolution):
        last = math.floor(math.log10(resolution)) - 1
        digits = min(max(math.floor(math.log10(abs(value))) - last + 1, 2), 17)
    return _float_text(float(f"{value:.{digits - 1}e}"))


def _float_text(value: float) -> str:
    """The shortest text of a finite number; always with a point, without which YAML 1.1 reads 1e-5 as text."""
    mantissa, _, exponent = repr(value).partition("e")
    if not exponent:
        return mantissa
    return f"{mantissa}{'' if '.' in mantissa else '.0'}e{int(exponent):+d}"


def _indents(text: str) -> tuple[int, int]:
    """Columns by which a file indents the keys of a mapping, and the dashes of a list, below their key."""
    mapping, offset, parent = 0, -1, 0
    for line in text.splitlines():
        content = line.lstrip(" ")
        if not content or content.startswith("#"):
            continue
        indent = len(line) - len(content)
        if content.startswith("- "):
            offset = indent - parent if offset < 0 else offset
        else:
            mapping = indent if 0 < indent < (mapping or indent + 1) and offset < 0 else mapping
            parent = indent if offset < 0 else parent
    return mapping or 2, max(offset, 0)


def _insert(entry: MutableMapping[str, Any], name: str, value: Any) -> None:
    """Put a new key before the last one of an entry."""
    if isinstance(entry, CommentedMap):
        entry.insert(max(len(entry) - 1, 1), name, value)
    else:
        entry[name] = value


class YamlDocument:
    """A YAML file of mappings that is changed key by key and written with its comments, order and number formats."""

    def __init__(self, path: Path) -> None:
        """Read the file. Raises OSError where it cannot be read, ruamel.yaml.error.YAMLError where it is not YAML."""
        text = path.read_text(encoding="utf-8")
        self._yaml = _yaml()
        mapping, offset = _indents(text)
        self._yaml.indent(mapping=mapping, sequence=offset + 2, offset=offset)
        self._yaml.width = max(WIDTH, *(len(line) for line in text.splitlines() or [""]))
        self.data: Any = self._yaml.load(text)

    def set_number(self, section: MutableMapping[str, Any], key: str, text: str) -> None:
        """Put a number (its text, see number_text) into a mapping of `data`."""
        section[key] = _Number(text)

    def set_numbers(self, section: MutableMapping[str, Any], key: str, texts: Sequence[str]) -> None:
        """Put a list of numbers (their texts) into a mapping of `data`, in one line; a new one as by `group`."""
        numbers = CommentedSeq([_Number(text) for text in texts])
        numbers.fa.set_flow_style()
        if key in section:
            section[key] = numbers
        else:
            _insert(section, key, numbers)

    def group(self, entry: MutableMapping[str, Any], name: str, keys: int) -> MutableMapping[str, Any]:
        """The mapping `name` of an entry of `data`; made where it is missing, for about so many keys.

        A new mapping stands before the entry's last key: what is written behind that one, blank lines and comments
        on what follows, belongs to the next entry.
        """
        if name not in entry:
            new = CommentedMap()
            if keys <= FLOW_KEYS:
                new.fa.set_flow_style()
            _insert(entry, name, new)
        found: MutableMapping[str, Any] = entry[name]
        return found

    def text(self, comment: str = "") -> str:
        """The file's new content, behind the lines of a comment."""
        stream = StringIO()
        self._yaml.dump(self.data, stream)
        return "".join(f"# {line}\n" for line in comment.splitlines()) + stream.getvalue()
