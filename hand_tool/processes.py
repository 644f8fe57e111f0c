"""Start and end the nodes of the stack as child processes, each with a log file."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType

from hand_ros.starting import WHEN_TOLD

READY_S = 180.0
"""Longest wait for the first frames of a hand: a first start compiles the model, on a busy machine for a minute."""
STOP_S = 15.0


class ProcessError(RuntimeError):
    """A process ended early or cannot be started; the message is one line."""


class Processes:
    """Context manager: at its end, the processes started in it are stopped by SIGINT in reverse order."""

    def __init__(self, logs: Path) -> None:
        """Write each process's output to logs/NAME.log."""
        self._logs = logs
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._optional: set[str] = set()

    def __enter__(self) -> Processes:
        """Make the folder of the logs."""
        self._logs.mkdir(parents=True, exist_ok=True)
        return self

    def __exit__(self, kind: type[BaseException] | None, _: BaseException | None, __: TracebackType | None) -> None:
        """Stop the processes that still run, the optional ones last: none may delay the vent of the hand."""
        with ExitStack() as stops:  # also those after one that does not end
            for name in sorted(self._running, key=lambda name: name not in self._optional):
                stops.callback(self.stop, name)

    def start(self, name: str, command: Sequence[str], *, optional: bool = False) -> None:
        """Start a node: the name of its executable, then its arguments.

        optional: the others do without it, so that `check` passes over its end, and `lost` reports it.
        """
        if optional:
            self._optional.add(name)
        self._begin(name, command, {})

    def prepare(self, name: str, command: Sequence[str]) -> None:
        """Read the program of a node into memory, which takes a second; the node itself starts with `go`."""
        self._begin(name, command, {WHEN_TOLD: "1"})

    def go(self) -> None:
        """Start every node that was prepared, unless its program has ended, which `check` reports."""
        for process in self._running.values():
            if process.stdin is not None and not process.stdin.closed:
                with suppress(BrokenPipeError), process.stdin:
                    process.stdin.write(b"go\n")

    def _begin(self, name: str, command: Sequence[str], environment: dict[str, str]) -> None:
        local = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        with (self._logs / f"{name}.log").open("wb") as log:
            self._running[name] = subprocess.Popen(
                [str(executable(command[0])), *command[1:]], stdout=log, stderr=subprocess.STDOUT,
                env=local | dict(os.environ) | environment, stdin=subprocess.PIPE if environment else None,
                start_new_session=True,  # Ctrl-C reaches this process only; it ends the others in order
            )  # fmt: skip

    def check(self) -> None:
        """Raise ProcessError if a process has ended that the others need."""
        for name, process in self._running.items():
            if name not in self._optional and process.poll() is not None:
                raise ProcessError(f"{name} ended with code {process.returncode}: {self._last_line(name)}")

    def lost(self) -> str:
        """The optional process that has ended since the last call, one line; "" for none."""
        for name in sorted(self._optional & self._running.keys()):
            process = self._running[name]
            if process.poll() is not None:
                self._optional.discard(name)
                del self._running[name]
                return f"{name} ended with code {process.returncode}: {self._last_line(name)}"
        return ""

    def stop(self, name: str) -> int:
        """End a process by SIGINT, return its exit code; SIGKILL and ProcessError if it does not end in STOP_S [s]."""
        process = self._running.pop(name)
        if process.stdin is not None:
            process.stdin.close()
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        try:
            return process.wait(timeout=STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            raise ProcessError(f"{name} did not end within {STOP_S:g} s: {self._last_line(name)}") from None

    def _last_line(self, name: str) -> str:
        lines = (self._logs / f"{name}.log").read_text(encoding="utf-8", errors="replace").split("\n")
        return next((line for line in reversed(lines) if line.strip()), "it printed nothing")


def executable(name: str) -> Path:
    """An executable of a node: lib/fluidic_hand/NAME of a sourced prefix or of this Python's installation.

    Raises ProcessError where it is not installed.
    """
    prefixes = [Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    for prefix in (*prefixes, Path(sys.prefix)):
        path = prefix / "lib" / "fluidic_hand" / name
        if path.is_file():
            return path
    raise ProcessError(f"the node {name} is not installed: run make build, then source env.bash")
