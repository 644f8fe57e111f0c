"""The version of this software. It is written once, in package.xml; setup.py and the source tree read it there."""

from __future__ import annotations

import re
from importlib import metadata
from pathlib import Path

UNKNOWN = "unknown"


def version() -> str:
    """The version in the source tree's package.xml, else that of the installed distribution."""
    package = Path(__file__).resolve().parent.parent / "package.xml"
    if package.is_file():
        found = re.search(r"<version>([^<]+)</version>", package.read_text(encoding="utf-8"))
        return found.group(1) if found else UNKNOWN
    try:
        return metadata.version("fluidic_hand")
    except metadata.PackageNotFoundError:
        return UNKNOWN
