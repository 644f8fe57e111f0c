"""Processor time of `hand --help`, next to that of the library that draws the help."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

from validation.bench.result import figure

ROOT = Path(__file__).resolve().parents[2]
ROUNDS = 7
GOAL_S = 0.4


def run(quick: bool) -> list[dict[str, Any]]:
    """The least of ROUNDS processes each, in turn, because other load only adds to it; quick: one of each."""
    rounds = 1 if quick else ROUNDS
    times = [(cpu_s("-m", "hand_tool", "--help"), cpu_s("-c", "import typer.rich_utils")) for _ in range(rounds)]
    ours, library = (min(column) for column in zip(*times, strict=True))
    return [
        figure("hand --help", ours, GOAL_S, "s CPU"),
        figure("import of the library that draws the help", library, None, "s CPU"),
    ]


def cpu_s(*arguments: str) -> float:
    """Processor time [s] of a Python process with these arguments."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    subprocess.run([sys.executable, *arguments], env=environment, capture_output=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
