"""The tool as a newcomer uses it: help with an example, typos, empty and foreign files."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from hand_tool.cli import app

SUBCOMMANDS = ("record", "simulate", "emulate-board", "demo")


def hand(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


@pytest.mark.parametrize("name", SUBCOMMANDS)
def test_help_has_an_example(name: str) -> None:
    """Fails when a subcommand's help lacks an example or its exit codes."""
    result = hand(name, "--help")
    assert result.exit_code == 0
    assert f"Example: hand {name}" in result.output
    assert "Exit codes" in result.output


def test_a_typo_is_bad_usage() -> None:
    """Fails when an unknown subcommand or option is anything but exit code 2."""
    assert hand("recrod").exit_code == 2
    assert hand("simulate", "--modle", "x").exit_code == 2


CASES = {
    "no such recording": (("simulate", "nowhere.mcap", "--out", "x.mcap"), "nowhere.mcap"),
    "empty recording": (("simulate", "empty.mcap", "--out", "x.mcap"), "empty.mcap"),
    "foreign recording": (("simulate", "text.mcap", "--out", "x.mcap"), "text.mcap"),
    "no port": (("emulate-board",), "--serial"),
    "two ports": (("emulate-board", "--serial", "a", "--can", "b"), "--serial"),
    "wrong probability": (("emulate-board", "--serial", "a", "--drop", "1.5"), "the allowed range is 0 to 1"),
    "wrong model": (("emulate-board", "--serial", "a", "--model", "text.mcap"), "text.mcap"),
    "wrong demo model": (("demo", "--model", "nowhere.yaml"), "nowhere.yaml"),
    "nothing to mend": (("record", "--repair", "nowhere"), "nowhere"),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_input_is_one_line_and_exit_code_2(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when bad input gives a traceback, several lines, another exit code, or a file that was not asked for."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "text.mcap").write_text("this is no recording\n", encoding="utf-8")
    arguments, line = CASES[case]
    result = hand(*arguments)
    assert result.exit_code == 2, result.output
    said = [text for text in result.output.splitlines() if text.strip()]
    assert len(said) == 1, said
    assert line in said[0]
    assert not (tmp_path / "x.mcap").exists()


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("recrod",), "'record'"),
        (("record", "--duration", "abc"), "'--duration'"),
        (("simulate",), "'recording'"),
        (("simulate", "--nonsense"), "--nonsense"),
        (("simulate", "nowhere.mcap", "--out", "x.mcap"), "nowhere.mcap"),
    ],
)
def test_the_executable_says_one_line(arguments: tuple[str, ...], line: str, tmp_path: Path) -> None:
    """Fails when the process itself answers bad usage with a box, a traceback, stdout or another exit code than 2."""
    command = [sys.executable, "-m", "hand_tool.cli", *arguments]
    result = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=60, check=False)
    assert result.returncode == 2
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1, result.stderr
    assert line in result.stderr
