"""How a subcommand ends: one line, and its own exit code."""

from __future__ import annotations

import pytest
import typer

from hand_tool.console import VERBOSITY, fail, running


@pytest.fixture(autouse=True)
def _not_verbose(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another test of this process may have called a subcommand with --verbose."""
    monkeypatch.setattr(VERBOSITY, "verbose", False)


def test_a_subcommand_that_fails_by_itself_keeps_its_code(capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when the end of a subcommand is taken for an error of its own: a second line, and code 2."""
    with pytest.raises(typer.Exit) as ended, running("up", errors=(RuntimeError,)):
        fail("up", "the controller ended with code 1", 1)
    assert ended.value.exit_code == 1
    assert capsys.readouterr().err == "hand up: the controller ended with code 1\n"


@pytest.mark.parametrize("error", [ValueError, OSError, KeyError])
def test_only_an_expected_error_becomes_a_line(error: type[Exception], capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when bad input shows a traceback, or an error of the program is hidden as bad input."""
    wanted: type[Exception] = KeyError if error is KeyError else typer.Exit
    with pytest.raises(wanted), running("patch"):
        raise error("no such joint")
    assert capsys.readouterr().err == ("" if error is KeyError else "hand patch: no such joint\n")
