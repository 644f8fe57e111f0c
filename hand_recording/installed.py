"""Where the installed configuration lies."""

from __future__ import annotations

from pathlib import Path

NAME = Path("config") / "hand.yaml"


def default_model() -> Path:
    """hand.yaml as installed with this package, or in its source tree. ValueError where there is none.

    pip and colcon both install it as PREFIX/share/fluidic_hand/config/hand.yaml.
    """
    for folder in Path(__file__).resolve().parents:
        for candidate in (folder / "share" / "fluidic_hand" / NAME, folder / NAME):
            if candidate.is_file():
                return candidate
    raise ValueError("no hand.yaml is installed with this program; give one with --model")


def differing_source(installed: Path, start: Path | None = None) -> Path | None:
    """hand.yaml of a source tree that differs from this installed copy; None where there is no such file.

    Looked for above the working folder (or `start`) and above the installed copy.
    """
    for folder in (*_upward(start or Path.cwd()), *_upward(installed.resolve().parent)):
        if _is_source_tree(folder):
            source = folder / NAME
            same = source.samefile(installed) or source.read_bytes() == installed.read_bytes()
            return None if same else source
    return None


def _upward(folder: Path) -> list[Path]:
    absolute = folder.absolute()
    return [absolute, *absolute.parents]


def _is_source_tree(folder: Path) -> bool:
    package = folder / "package.xml"
    if not (package.is_file() and (folder / "setup.py").is_file() and (folder / NAME).is_file()):
        return False
    return "<name>fluidic_hand</name>" in package.read_text(encoding="utf-8", errors="replace")
