"""The description of the hand that a subcommand uses, and its hash, so that a result can be traced to it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from hand_recording.installed import default_model, differing_source
from hand_tool.console import note
from hand_tool.paths import check_file


@dataclass(frozen=True, slots=True)
class ChosenModel:
    """A hand.yaml. sha256: of its bytes, hexadecimal.  differs_from: the source file it should equal."""

    path: Path
    sha256: str
    differs_from: Path | None = None

    def as_json(self) -> dict[str, str]:
        """For json.dumps."""
        return {"path": str(self.path), "sha256": self.sha256}

    def print(self, as_json: bool = False) -> None:
        """Say on standard error which file is used. The warning about an outdated copy is printed with --json, too."""
        if not as_json:
            note(f"model: {self.path} (sha256 {self.sha256[:8]})")
        if self.differs_from is not None:
            source = self.differs_from
            note(
                f"warning: {source} differs from the installed copy {self.path}, which is used; "
                f"give --model {source}, or install again (make build)"
            )


def choose_model(given: Path | None) -> ChosenModel:
    """The file given with --model, else the installed one. Raises ValueError where it cannot be read."""
    path = check_file(given or default_model())
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return ChosenModel(path, digest, differing_source(path) if given is None else None)
