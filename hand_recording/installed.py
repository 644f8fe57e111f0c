"""Where the installed configuration lies."""

from __future__ import annotations

from pathlib import Path


def default_model() -> Path:
    """hand.yaml as installed beside this package, or in its source tree. ValueError where there is none."""
    for folder in Path(__file__).resolve().parents:
        for candidate in (folder / "share" / "fluidic_hand" / "config" / "hand.yaml", folder / "config" / "hand.yaml"):
            if candidate.is_file():
                return candidate
    raise ValueError("no hand.yaml beside this program; give one with --model")
