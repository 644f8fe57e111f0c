"""docs/commands.md: the reference of the command `hand`, from its own help texts."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any

import typer

from hand_tool.cli import app

EVERYWHERE = ("--json", "--quiet", "--verbose", "--help")
"""Options of nearly every command, explained once."""


def markdown() -> str:
    """A section for each command: what it does, its arguments and options, its example and exit codes."""
    command = typer.main.get_command(app)
    return "\n\n".join(_sections(command, "hand", typer.Context(command, info_name="hand")))


def _sections(command: Any, name: str, context: Any) -> Iterator[str]:
    if hasattr(command, "list_commands"):
        for child in command.list_commands(context):
            yield from _sections(command.get_command(context, child), f"{name} {child}", context)
        return
    yield f"### `{name}`"
    yield from (_paragraph(part) for part in inspect.cleandoc(command.help or "").split("\n\n"))
    rows = [row for parameter in command.params if (row := _row(parameter))]
    if rows:
        yield "\n".join(["| argument or option | meaning | default |", "|---|---|---|", *rows])


def _paragraph(text: str) -> str:
    """A paragraph of a help text on one line; its example as code."""
    line = " ".join(text.split())
    start, _, rest = line.partition(": ")
    return f"{start}: `{rest}`" if start in {"Example", "Examples"} else line


def _row(parameter: Any) -> str:
    names = [name for name in (*parameter.opts, *parameter.secondary_opts) if name.startswith("-")]
    if set(names) & set(EVERYWHERE):
        return ""
    shown = ", ".join(f"`{name}`" for name in names) or f"`{parameter.metavar or parameter.name.upper()}`"
    help_text = " ".join((getattr(parameter, "help", None) or "").split()).replace("|", "\\|")
    return f"| {shown} | {help_text} | {_default(parameter)} |"


def _default(parameter: Any) -> str:
    if parameter.required:
        return "required"
    value = parameter.default
    absent = value is None or value is False or callable(value) or str(value) in {"", "()", "[]"}
    return "" if absent else f"`{getattr(value, 'value', value)}`"
