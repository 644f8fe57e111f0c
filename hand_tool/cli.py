"""The tool `hand`: its subcommands, and how every one of them fails: one line, exit code 2."""

from __future__ import annotations

import sys

import typer

from hand_tool.demo import demo
from hand_tool.emulate_board import emulate_board
from hand_tool.record import record
from hand_tool.simulate import simulate

app = typer.Typer(
    name="hand",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Record, simulate and try a robot hand with flexible fluidic actuators.",
)
app.command()(record)
app.command()(simulate)
app.command("emulate-board")(emulate_board)
app.command()(demo)


def main() -> None:
    """Entry point of the executable `hand`."""
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
