"""Replace files of equal content below a folder by hard links to one copy.

Wheels cannot hold links, so each ROS library lies three times in the virtual environment, under its three names.
pip replaces a file by a new one and never writes into it, hence a shared copy does not change when a package does.
"""

from __future__ import annotations

import hashlib
import os
import sys
from pathlib import Path

SMALLEST_BYTES = 4096


def share_duplicates(folder: Path) -> int:
    """Link files of equal content and mode; returns the bytes that are free again."""
    first: dict[tuple[bytes, int], Path] = {}
    saved = 0
    for path in sorted(folder.rglob("*")):
        if path.is_symlink() or not path.is_file() or path.stat().st_size < SMALLEST_BYTES:
            continue
        key = (hashlib.sha256(path.read_bytes()).digest(), path.stat().st_mode)
        kept = first.setdefault(key, path)
        if kept.samefile(path):
            continue
        link = path.with_name(path.name + ".link")
        os.link(kept, link)
        saved += path.stat().st_size
        link.replace(path)
    return saved


if __name__ == "__main__":
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        print("share_duplicates: give one existing folder", file=sys.stderr)
        sys.exit(2)
    print(f"share_duplicates: {share_duplicates(Path(sys.argv[1])) / 1e6:.0f} MB shared")
