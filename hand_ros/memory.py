"""Give back the memory of large messages: by the allocator of the process and by the readers of Fast DDS.

Without this, one message of 16 MB leaves 33 MB in a node for good.
"""

from __future__ import annotations

import ctypes
from collections.abc import MutableMapping
from pathlib import Path

MMAP_THRESHOLD = -3
"""Parameter of mallopt (malloc.h)."""
LARGE_BYTES = 131_072
"""Larger blocks go back to the system when they are freed; by default the threshold grows with each such block."""
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
FROM_FILE = "RMW_FASTRTPS_USE_QOS_FROM_XML"
IN_WORKING_FOLDER = "DEFAULT_FASTRTPS_PROFILES.xml"


def return_large_blocks() -> bool:
    """Let the allocator give large blocks back to the system; False where the C library has no such setting."""
    try:
        return bool(ctypes.CDLL(None).mallopt(MMAP_THRESHOLD, LARGE_BYTES))
    except (AttributeError, OSError):
        return False


def use_profiles(file: Path, environment: MutableMapping[str, str], folder: Path) -> bool:
    """Let Fast DDS use our profiles, before it is started; False where the user has profiles, or ours are not there.

    folder: the working folder, where Fast DDS looks for a file of its own.
    """
    given = any(name in environment for name in (*PROFILES, FROM_FILE)) or (folder / IN_WORKING_FOLDER).exists()
    if given or not file.is_file():
        return False
    environment[PROFILES[0]] = str(file)
    environment[FROM_FILE] = "1"
    return True
