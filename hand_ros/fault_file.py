"""A latched fault in a small file, so that a restart of the node does not clear it.

The file is one line of JSON: time, fault and node. It exists while a fault is latched. It is written next to its place,
flushed to the disk and renamed, so that a crash leaves the old or the new file. A file that cannot be read, or a folder
that cannot be written, counts as a fault: a node that cannot remember its latch does not drive.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

LARGEST_BYTES = 65536
"""Largest fault file; a larger one was not written by a node of the hand and is not read."""
RETRY_NS = 1_000_000_000
"""Pause before a failed write is tried again [ns]."""


def state_path(parameter: str, namespace: str, node: str, environment: Mapping[str, str]) -> Path:
    """Where a node keeps its fault: the parameter, or NAMESPACE.NODE.json under $ROS_HOME or ~/.ros."""
    if parameter:
        return Path(parameter).expanduser()
    home = environment.get("ROS_HOME") or "~/.ros"
    name = ".".join([*namespace.strip("/").split("/"), node]).strip(".")
    return Path(home).expanduser() / "fluidic_hand" / f"{name}.json"


class FaultFile:
    """The file of one node."""

    def __init__(self, path: Path, node: str) -> None:
        """node: fully qualified name, stored with the fault."""
        self.path = path
        self.problem = ""
        self._node = node
        self._kept = ""
        self._retry_ns: int | None = None

    def read(self) -> str:
        """The fault to latch at the start: the stored one, or why the file cannot be used, one line; empty for none."""
        try:
            self._probe()
            if not os.path.lexists(self.path):
                return ""
            record = self._record()
            fault, when = _text(record, "fault"), _text(record, "time")
        except (OSError, ValueError) as error:
            self._kept = f"the state file {self.path} cannot be used: {_reason(error)}"
        else:
            self._kept = f"{fault} (latched {when}, before a restart)"
        return self._kept

    def keep(self, fault: str, now_ns: int) -> bool:
        """Store a latched fault, once; now_ns [ns] of a monotonic clock paces further attempts after a failure.

        Returns False where an attempt failed; `problem` then is the reason, one line.
        """
        if fault == self._kept or (self._retry_ns is not None and now_ns < self._retry_ns):
            return True
        record = {"time": datetime.now(UTC).isoformat(timespec="seconds"), "fault": fault, "node": self._node}
        try:
            self._write(json.dumps(record) + "\n")
        except OSError as error:
            self._retry_ns = now_ns + RETRY_NS
            self.problem = f"the latched fault cannot be stored in {self.path}: {_reason(error)}"
            return False
        self._kept, self._retry_ns, self.problem = fault, None, ""
        return True

    def clear(self) -> None:
        """Remove the stored fault. Raises OSError where the file or its folder cannot be written."""
        self._probe()
        self.path.unlink(missing_ok=True)
        self._kept, self._retry_ns, self.problem = "", None, ""

    def _record(self) -> Any:
        if not self.path.is_file():
            raise ValueError("it is not a regular file")
        with self.path.open("rb") as file:
            content = file.read(LARGEST_BYTES + 1)
        if len(content) > LARGEST_BYTES:
            raise ValueError(f"it is larger than {LARGEST_BYTES} bytes")
        return json.loads(content.decode("utf-8"))

    @property
    def _beside(self) -> Path:
        return self.path.with_name(f".{self.path.name}.{os.getpid()}")

    def _probe(self) -> None:
        """Raise OSError where the folder cannot be written; a permission bit says too little."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._beside.write_bytes(b"")
        self._beside.unlink()

    def _write(self, line: str) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with self._beside.open("w", encoding="utf-8") as file:
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
            self._beside.replace(self.path)
        except OSError:
            self._beside.unlink(missing_ok=True)
            raise
        folder = os.open(self.path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def _text(record: Any, key: str) -> str:
    value = record.get(key) if isinstance(record, dict) else None
    if not isinstance(value, str) or not value.strip():
        raise ValueError(f"it has no text {key!r}")
    return " ".join(value.split())


def _reason(error: OSError | ValueError) -> str:
    if isinstance(error, OSError):
        return error.strerror or type(error).__name__
    if isinstance(error, json.JSONDecodeError | UnicodeDecodeError):
        return "it is not JSON"
    return str(error)
