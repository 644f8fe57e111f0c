"""The subcommands that need `validation`, which a robot need not install, say so in one line where it is absent."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

import typer


@contextmanager
def needs_validation(command: str) -> Iterator[None]:
    """Context of lazy imports from `validation`: a missing module ends the command with one line and exit code 2."""
    try:
        yield
    except ModuleNotFoundError as error:
        hint = (
            "install it with: pip install 'fluidic_hand[validation]' (in the source tree: pip install '.[validation]')"
        )
        print(f"hand {command}: the Python module {error.name} is not installed; {hint}", file=sys.stderr)
        raise typer.Exit(2) from None
