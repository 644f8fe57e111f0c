"""The tool `hand`: its subcommands, and how every one of them fails: one line, exit code 2."""

from __future__ import annotations

import sys

import typer

from hand_tool.demo import demo
from hand_tool.diagnose import diagnose
from hand_tool.emulate_board import emulate_board
from hand_tool.excite import excite
from hand_tool.identify import app as identify
from hand_tool.magnet import magnet
from hand_tool.new_effect import new_effect
from hand_tool.record import record
from hand_tool.reproduce import reproduce
from hand_tool.simulate import simulate
from hand_tool.trial import app as trial

app = typer.Typer(
    name="hand",
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Record, simulate and try a robot hand with flexible fluidic actuators.",
)
app.command()(record)
app.command()(simulate)
app.command("emulate-board")(emulate_board)
app.command()(demo)
app.command()(diagnose)
app.command()(excite)
app.add_typer(identify, name="identify")
app.add_typer(trial, name="trial")
app.command()(magnet)
app.command("new-effect")(new_effect)
app.command()(reproduce)


def main() -> None:
    """Entry point of the executable `hand`; bad usage is one line, without a command the help."""
    arguments = sys.argv[1:]
    try:
        code = typer.main.get_command(app).main(arguments or ["--help"], prog_name="hand", standalone_mode=False)
    except (KeyboardInterrupt, typer.Abort):
        sys.exit(130)
    except Exception as error:
        if not hasattr(error, "format_message"):  # the usage errors of every click that typer comes with
            raise
        context = getattr(error, "ctx", None)
        command = context.command_path if context else "hand"
        message = " ".join(error.format_message().split()).rstrip(".?")
        print(f"{command}: {message}. See {command} --help.", file=sys.stderr)
        sys.exit(2)
    sys.exit(code if arguments else 2)


if __name__ == "__main__":
    main()
