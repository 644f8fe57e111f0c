"""The command `hand`: its subcommands, and one line with exit code 2 for bad usage of any of them."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Annotated

import typer

from hand_recording.version import version
from hand_tool.check_board import check_board
from hand_tool.compare import compare
from hand_tool.demo import demo
from hand_tool.diagnose import diagnose
from hand_tool.emulate_board import emulate_board
from hand_tool.excite import excite
from hand_tool.identify import app as identify
from hand_tool.live import enable, grasp, move, stop, watch
from hand_tool.magnet import magnet
from hand_tool.new_effect import new_effect
from hand_tool.patch import patch
from hand_tool.predict import predict
from hand_tool.record import record
from hand_tool.reproduce import reproduce
from hand_tool.simulate import simulate
from hand_tool.studio import studio
from hand_tool.trial import app as trial
from hand_tool.up import up
from hand_tool.urdf import urdf

app = typer.Typer(
    name="hand",
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    help="Record, simulate, identify and diagnose a robot hand with flexible fluidic actuators.\n\n"
    "Example: hand demo --out out/demo\n\n"
    "Exit codes: 0 done, 1 the command found what it is asked to fail on, 2 bad usage or bad input, 130 Ctrl-C.",
)
RUNNING, RECORDINGS, BOARDS, MODELS, PROOF = (
    "A running hand",
    "Recordings and their diagnosis",
    "Boards",
    "Models",
    "Demonstration and proof",
)
"""Groups of subcommands in the help, in its order."""
for group, subcommands in {
    RUNNING: (studio, up, move, grasp, watch, stop, enable),
    RECORDINGS: (record, simulate, excite, diagnose, predict, compare),
    BOARDS: (check_board, emulate_board),
    MODELS: (patch, urdf, new_effect, magnet),
    PROOF: (demo, reproduce),
}.items():
    for subcommand in subcommands:
        app.command(subcommand.__name__.replace("_", "-"), rich_help_panel=group)(subcommand)
app.add_typer(identify, name="identify", rich_help_panel=RECORDINGS)
app.add_typer(trial, name="trial", rich_help_panel=PROOF)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"hand {version()}")
        raise typer.Exit


@app.callback()
def _options(
    show_version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Options of the command itself; the help text above belongs to the application."""


def run(arguments: Sequence[str]) -> int:
    """Run a command line and return its exit code; without a subcommand print the help and return 2.

    Raises KeyboardInterrupt where a subcommand was aborted.
    """
    try:
        command = typer.main.get_command(app)
        code = command.main(list(arguments) or ["--help"], prog_name="hand", standalone_mode=False)
    except typer.Abort as abort:
        raise KeyboardInterrupt from abort
    except Exception as error:
        if not hasattr(error, "format_message"):  # every usage error of the click that typer comes with has it
            raise
        context = getattr(error, "ctx", None)
        name = context.command_path if context else "hand"
        message = " ".join(error.format_message().split()).rstrip(".?")
        print(f"{name}: {message}. See {name} --help.", file=sys.stderr)
        return 2
    return int(code or 0) if arguments else 2
