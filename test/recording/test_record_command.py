"""`hand record` as its user meets it, without ROS."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from hand_tool.record import record

APP = typer.Typer()
APP.command()(record)


def _run(*arguments: str) -> tuple[int, str, str]:
    result = CliRunner().invoke(APP, list(arguments))
    return result.exit_code, result.stdout, result.stderr


def test_help_has_an_example() -> None:
    """Breaks when the help does not show how to use the command."""
    code, out, _ = _run("--help")
    assert code == 0
    assert "Example: hand record --out" in out


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--repair", "gone"], "gone does not exist"),
        (["--duration", "nan"], "duration nan"),
        (["--duration", "-1"], "duration -1.0"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(arguments: list[str], reason: str) -> None:
    """Breaks when bad input ends in a traceback or looks like success."""
    code, out, err = _run(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("hand record: ")
    assert reason in err
    assert err.count("\n") == 1


def test_repair_says_what_it_did(make_bag: Callable[..., Path]) -> None:
    """Breaks when repairing does not report what was recovered and what was lost."""
    path = make_bag("a.mcap")
    whole = path.read_bytes()
    assert "nothing to repair" in _run("--repair", str(path))[1]
    path.write_bytes(whole[:-100])
    code, out, _ = _run("--repair", str(path), "--json")
    report = json.loads(out)
    assert code == 0
    assert report["changed"]
    assert sum(report["messages"].values()) == 700
    assert report["lost_bytes"] > 0
    path.write_bytes(whole[: len(whole) // 2])
    assert "messages recovered" in _run("--repair", str(path))[1]
