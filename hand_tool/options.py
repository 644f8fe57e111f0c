"""Options that several subcommands share, so that they are spelled and explained in one way."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hand_tool.console import VERBOSITY


def _set_quiet(value: bool) -> bool:
    VERBOSITY.quiet = value
    return value


def _set_verbose(value: bool) -> bool:
    VERBOSITY.verbose = value
    return value


AsJson = Annotated[bool, typer.Option("--json", help="Print the outcome as JSON.")]
Model = Annotated[Path | None, typer.Option(help="The description of the hand, hand.yaml. Default: the installed one.")]
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", callback=_set_quiet, help="Errors only on standard error, no progress bar.")
]
Verbose = Annotated[
    bool, typer.Option("--verbose", "-v", callback=_set_verbose, help="Print the traceback of an error as well.")
]
