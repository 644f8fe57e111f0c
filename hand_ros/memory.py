"""Memory of a node: large messages are given back, and Python's garbage collector does not stop it in motion.

Without the first, one message of 16 MB leaves 33 MB in a node for good: in the allocator of the process and in the
readers of Fast DDS. Without the second, a collection visits every object of the compiler, which takes up to 220 ms in a
process that has compiled its functions and 75 ms where it has loaded them; the hand is vented after 100 ms.
"""

from __future__ import annotations

import ctypes
import gc
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


def spare_collections() -> None:
    """Collect what is garbage, and let later collections leave out all that is alive now. Call it while vented."""
    gc.unfreeze()  # what an earlier call has left out may be garbage by now
    gc.collect()
    gc.freeze()


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
