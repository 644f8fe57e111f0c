"""Entry point of the executable `hand`: Ctrl-C is handled first, then the subcommands are loaded."""

from __future__ import annotations

import sys

from hand_tool import interrupts


def main() -> None:
    """Run the command line of this process and exit with its code."""
    interrupts.install()
    try:
        from hand_tool.cli import run

        code = run(sys.argv[1:])
    except (KeyboardInterrupt, interrupts.Interrupted):
        interrupts.report()
        code = interrupts.EXIT_CODE
    except BaseException:
        interrupts.wait_if_ending()  # an error that ending the child processes caused is not reported
        raise
    interrupts.wait_if_ending()
    sys.exit(code)
