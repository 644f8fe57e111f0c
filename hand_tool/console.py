"""What every subcommand shares on standard error: notes, progress bars, errors of one line with exit code 2."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from hand_tool import interrupts

if TYPE_CHECKING:
    from rich.progress import Progress


@dataclass
class Verbosity:
    """quiet: errors only on standard error.  verbose: the traceback of an error as well."""

    quiet: bool = False
    verbose: bool = False


VERBOSITY = Verbosity()
EXTRA_OF = dict.fromkeys(("dask", "distributed", "pyarrow", "pysindy"), "analysis") | {"viser": "studio"}
"""Extras by what they install; every other module that can be missing is of `validation`."""
ROS_MODULES = ("rclpy", "hand_msgs", "ament_index_python")


def note(text: str) -> None:
    """Print a line to standard error unless --quiet is given."""
    if not VERBOSITY.quiet:
        print(text, file=sys.stderr)


@contextmanager
def running(
    name: str, *outputs: Path, about: Path | None = None, errors: tuple[type[Exception], ...] = ()
) -> Iterator[interrupts.Outputs]:
    """Context of a subcommand: an expected error becomes one line and exit code 2, a Ctrl-C raises Interrupted.

    name: the words after `hand`.  outputs: what it will write.  about: the file that a message without it is about.
    errors: what is expected besides ValueError and OSError.
    """
    state = interrupts.begin(interrupts.Outputs(f"hand {name}", outputs))
    try:
        yield state
    except typer.Exit:  # its line is printed
        raise
    except Exception as error:
        if interrupts.was_raised():
            raise interrupts.Interrupted from error
        if not isinstance(error, (ValueError, OSError, ModuleNotFoundError, *errors)):
            raise
        fail(name, _line(error, about), 2)


def _line(error: Exception, about: Path | None) -> str:
    """One line for an expected error; about: the file that it is about where it names none."""
    if isinstance(error, ModuleNotFoundError):
        return _missing(error)
    if isinstance(error, OSError):
        return _one_line(error)
    line = " ".join(str(error).split())
    return line if about is None or str(about) in line else f"{about}: {line}"


def fail(name: str, line: str, code: int) -> None:
    """Print the line of a failed subcommand and raise typer.Exit; with --verbose the traceback of the error as well."""
    if VERBOSITY.verbose:
        traceback.print_exc()
    print(f"hand {name}: {line}", file=sys.stderr)
    raise typer.Exit(code) from None


def require(*modules: str) -> None:
    """Raise ModuleNotFoundError for the first module that is not installed; none is imported."""
    for module in modules:
        if find_spec(module) is None:
            raise ModuleNotFoundError(f"No module named {module!r}", name=module)


def _one_line(error: OSError) -> str:
    if error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror}"
    return " ".join(str(error).split()) or type(error).__name__


def _missing(error: ModuleNotFoundError) -> str:
    """How to install a module that is not there."""
    module = (error.name or "").split(".")[0]
    if module in ROS_MODULES or module.endswith("_msgs"):
        return f"this needs ROS 2 Jazzy and the Python module {module} is not found; run: source env.bash"
    extra = EXTRA_OF.get(module, "validation")
    how = f"pip install 'fluidic_hand[{extra}]' (in the source tree: pip install '.[{extra}]')"
    return f"the Python module {module} is not installed; install it with: {how}"


@contextmanager
def progress_bar(as_json: bool, counted: bool = False) -> Iterator[Progress]:
    """A progress bar on standard error, none with --quiet, --json or to a file. counted: "3/11", not "27%"."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    share = MofNCompleteColumn() if counted else TaskProgressColumn()
    console = Console(stderr=True)
    hidden = as_json or VERBOSITY.quiet or not console.is_terminal
    columns = (TextColumn("{task.description}"), BarColumn(), share, TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=hidden) as progress:
        yield progress
