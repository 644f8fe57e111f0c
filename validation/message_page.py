"""docs/messages.md: the fields of the messages and of the action, from their definitions in hand_msgs."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

DEFINITIONS = Path(__file__).resolve().parents[1] / "hand_msgs"
PARTS = ("Goal", "Result", "Feedback")
"""The parts of an action, in the order of its file."""
UNIT = re.compile(r"\[(?P<unit>[^\]]+)\],? *")
FIELD = re.compile(r"(?P<type>\S+) +(?P<name>\w+) *(?:# *(?P<comment>.*))?")


class Field(NamedTuple):
    """A field of a message. unit: "" for a field without one."""

    name: str
    type_name: str
    unit: str
    meaning: str


def messages() -> str:
    """A section for each message."""
    return "\n\n".join(_section(path, [""]) for path in sorted((DEFINITIONS / "msg").glob("*.msg")))


def actions() -> str:
    """A section for each action."""
    return "\n\n".join(_section(path, list(PARTS)) for path in sorted((DEFINITIONS / "action").glob("*.action")))


def fields(text: str) -> Iterator[Field]:
    """The fields of a definition. Raises ValueError for a line without a field."""
    for line in text.splitlines():
        if not line or line.startswith("#"):
            continue
        found = FIELD.fullmatch(line.strip())
        if found is None:
            raise ValueError(f"no field of a message: {line!r}")
        comment = found["comment"] or ""
        unit = UNIT.match(comment)
        meaning = comment[unit.end() :] if unit else comment
        yield Field(found["name"], found["type"], unit["unit"].replace(".", " ") if unit else "", meaning)


def _section(path: Path, parts: list[str]) -> str:
    """The purpose of a definition and a table for each of its parts, which lines of --- separate."""
    text = path.read_text(encoding="utf-8")
    purpose = " ".join(line.lstrip("# ") for line in takewhile(lambda line: line.startswith("#"), text.splitlines()))
    texts = re.split(r"^---$", text, flags=re.MULTILINE)
    tables = [_table(part, fields(each)) for part, each in zip(parts, texts, strict=True)]
    return "\n\n".join([f"### hand_msgs/{path.parent.name}/{path.stem}\n{purpose}", *tables])


def _table(part: str, rows: Iterator[Field]) -> str:
    head = [f"{part}:", ""] if part else []
    lines = [*head, "| field | type | unit | meaning |", "|---|---|---|---|"]
    lines += [f"| `{row.name}` | {row.type_name} | {row.unit} | {row.meaning} |" for row in rows]
    return "\n".join(lines)
