"""From a YAML file to plain data: numbers as YAML 1.2 reads them, keys written once, errors in one line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml


class DescriptionError(ValueError):
    """A YAML file is not what it should be; the message is one line."""


MAX_BYTES = 1_000_000
"""Largest file that is read; the description of 255 joints with every key of its own has half of it."""
MAX_NODES = 40_000
"""Most keys, values and lists of a file; parsing so many takes about 2 s."""


class _Loader(yaml.SafeLoader):
    """Safe loader with the scalars of YAML 1.2's core schema, for a limited number of nodes.

    YAML 1.1, which PyYAML speaks by itself, reads 1e5 as text, 0200 as 128, 3:20 as 200 and yes as true.
    """

    nodes = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Count the nodes as they are found, so that a file of too many is refused before most of it is parsed."""
        self.nodes += 1
        if self.nodes > MAX_NODES:
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            problem = f"more than {MAX_NODES} keys and values; at most so many are allowed"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=mark)
        return super().compose_node(parent, index)  # type: ignore[no-untyped-call]


_Loader.yaml_implicit_resolvers = {}
for _tag, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?[0-9]+", list("-+0123456789")),
    ("float", r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?", list("-+.0123456789")),
    ("float", r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)", list("-+.")),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(rf"^(?:{_pattern})$"), _first)


def _integer(loader: _Loader, node: yaml.ScalarNode) -> int:
    return int(loader.construct_scalar(node))


def _mapping(loader: _Loader, node: yaml.MappingNode) -> dict[str, Any]:
    seen: set[str] = set()
    for key_node, _ in node.value:
        key = loader.construct_object(key_node)  # type: ignore[no-untyped-call]
        if not isinstance(key, str):
            raise yaml.MarkedYAMLError(problem="a key must be text", problem_mark=key_node.start_mark)
        if key in seen:
            raise yaml.MarkedYAMLError(problem=f"key {key!r} is there twice", problem_mark=key_node.start_mark)
        seen.add(key)
    return dict(loader.construct_pairs(node, deep=True))  # type: ignore[no-untyped-call]


_Loader.add_constructor("tag:yaml.org,2002:int", _integer)
_Loader.add_constructor("tag:yaml.org,2002:map", _mapping)


def load_yaml(path: Path) -> Any:
    """The file's data; DescriptionError, one line, for a missing, empty or broken file."""
    try:
        with path.open("rb") as stream:
            content = stream.read(MAX_BYTES + 1)
        if len(content) > MAX_BYTES:
            raise DescriptionError(f"{path}: is larger than {MAX_BYTES} bytes, the largest file that is read")
        text = content.decode()
    except OSError as error:
        raise DescriptionError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise DescriptionError(f"{path}: is not UTF-8 text") from None
    try:
        data = yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else "?"
        raise DescriptionError(f"{path}: line {line}: {error.problem}") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise DescriptionError(f"{path}: is not YAML: {' '.join(str(error).split())}") from None
    if data is None:
        raise DescriptionError(f"{path}: is empty")
    return data
