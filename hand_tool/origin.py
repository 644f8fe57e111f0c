"""How a result was made: when, by which version and command, from which model, and how long it took."""

from __future__ import annotations

import shlex
import sys
import time
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from hand_recording.version import version
from hand_tool.chosen_model import ChosenModel


@dataclass(frozen=True, slots=True)
class Origin:
    """Of a command that runs now, from the moment at which this is made. model, seed: None where it has none."""

    model: ChosenModel | None = None
    seed: int | None = None
    begun_s: float = field(default_factory=time.monotonic)

    def document(self) -> dict[str, Any]:
        """The entry `made` of report.json, which names the model elsewhere."""
        document = made()
        if self.seed is not None:
            document["seed"] = self.seed
        document["duration_s"] = round(time.monotonic() - self.begun_s, 1)
        if self.model is not None:
            document["model_sha256"] = self.model.sha256
        return document

    def of_page(self) -> dict[str, Any]:
        """The same with the path of the model, for hand_pages.results.made_rows."""
        return self.document() | ({} if self.model is None else {"model": str(self.model.path)})


def made() -> dict[str, Any]:
    """Date, version and command of a page that is written now."""
    return {"date": datetime.now(UTC).isoformat(timespec="seconds"), "version": version(), "command": command()}


def command() -> str:
    """The command line of this process; "" where this is not the command `hand`."""
    program = Path(sys.argv[0])
    ours = program.name == "hand" or (program.parent.name, program.name) == ("hand_tool", "__main__.py")
    return shlex.join(["hand", *sys.argv[1:]]) if ours else ""
