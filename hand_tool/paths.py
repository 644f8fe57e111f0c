"""Checks of input and output paths. They need no library and run before anything slow is imported.

Each raises ValueError with one line: the path, what is wrong, what is allowed.
"""

from __future__ import annotations

import os
from pathlib import Path
from tempfile import TemporaryFile


def check_file(path: Path) -> Path:
    """An input file exists and is not empty, else ValueError."""
    if path.is_dir():
        raise ValueError(f"{path} is a folder; a file is expected")
    return check_exists(path)


def check_exists(path: Path) -> Path:
    """An input file or folder exists and is not empty, else ValueError."""
    if not path.exists():
        raise ValueError(f"{path} does not exist")
    if not os.access(path, os.R_OK):
        raise ValueError(f"{path} cannot be read: permission denied")
    if path.is_file() and path.stat().st_size == 0:
        raise ValueError(f"{path} is empty")
    if path.is_dir() and not any(path.iterdir()):
        raise ValueError(f"{path} is an empty folder")
    return path


def check_folder(path: Path) -> Path:
    """An output folder exists and is writable, or can be made, else ValueError."""
    if path.exists() and not path.is_dir():
        raise ValueError(f"{path} is a file; the output must be a folder, new or existing")
    _check_writable(path)
    return path


def check_new(path: Path, kind: str = "recordings") -> Path:
    """An output does not exist yet and can be made, else ValueError; of recordings, as their writer says it."""
    if path.exists() or path.is_symlink():
        raise ValueError(f"{path} exists already; {kind} are never overwritten")
    _check_writable(path)
    return path


def _check_writable(path: Path) -> None:
    parent = next((folder for folder in (path, *path.absolute().parents) if folder.exists()), Path("/"))
    if not parent.is_dir():
        raise ValueError(f"{path} cannot be written: {parent} is a file")
    try:
        with TemporaryFile(dir=parent):  # permissions do not decide for root or on a read-only file system
            pass
    except OSError as error:
        raise ValueError(f"{path} cannot be written: no file can be made in {parent} ({error.strerror})") from None
