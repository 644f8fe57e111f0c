"""Checks of the firmware's C on this machine: branch coverage by gcov, and runs under sanitizers."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from validation.c_safety import FIRMWARE, HOST, OPTIONS, build

SANITIZERS = ("-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer")


@dataclass(frozen=True, slots=True)
class Part:
    """A part of the firmware with the program that replays its traces. sources: the files to check."""

    name: str
    sources: tuple[Path, ...]
    runner: tuple[Path, ...]
    tests: tuple[str, ...]


SAFETY = Part(
    "safety",
    (FIRMWARE / "hand_safety.c",),
    (HOST / "replay.c", HOST / "replay_main.c"),
    ("test/control/test_safety_layer.py",),
)
BOARD = Part(
    "board",
    (FIRMWARE / "board" / "hand_board.c", FIRMWARE / "board" / "hand_wire.c"),
    (FIRMWARE / "hand_safety.c", HOST / "board_replay.c", HOST / "board_replay_main.c"),
    ("test/control/test_board_sample.py",),
)
PARTS = (SAFETY, BOARD)


def branches(part: Part, traces: Path, folder: Path) -> tuple[int, list[str]]:
    """Number of branches of the part's sources, and each that the traces do not take, as file:line branch k."""
    objects = [_compiled(source, folder, "--coverage") for source in part.sources]
    runner = [_compiled(source, folder) for source in part.runner]
    program = folder / part.name
    _call("cc", "--coverage", *objects, *runner, "-o", program, folder=folder)
    _call(program, traces, folder=folder)
    count, missing = 0, []
    for source in part.sources:
        report = _call(
            "gcov", "--branch-probabilities", "--json-format", "--stdout", f"{source.stem}.gcda", folder=folder
        )
        for line in json.loads(report)["files"][0]["lines"]:
            count += len(line["branches"])
            untaken = [k for k, branch in enumerate(line["branches"]) if branch["count"] == 0]
            missing += [f"{source.name}:{line['line_number']} branch {k}" for k in untaken]
            missing += [f"{source.name}:{line['line_number']}"] if line["count"] == 0 else []
    return count, missing


def sanitized(part: Part, traces: Path, folder: Path) -> str:
    """Replay the traces under address and undefined-behaviour sanitizers. RuntimeError with their report."""
    program = build(f"{part.name}-sanitized", (*part.sources, *part.runner), *SANITIZERS, folder=folder)
    return _call(program, traces, folder=folder)


def _compiled(source: Path, folder: Path, *options: str) -> Path:
    made = folder / f"{source.stem}.o"
    _call("cc", *OPTIONS, "-O0", "-g", *options, "-c", source, "-o", made, folder=folder)
    return made


def _call(*command: object, folder: Path) -> str:
    words: Sequence[str] = [str(part) for part in command]
    done = subprocess.run(words, check=False, capture_output=True, text=True, cwd=folder, timeout=300)
    if done.returncode != 0:
        raise RuntimeError(f"{words[0]} fails: {done.stdout.strip()} {done.stderr.strip()}")
    return done.stdout
