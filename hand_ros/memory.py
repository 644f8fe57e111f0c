"""Memory of a node: large messages are given back; neither the collector nor the system nor the log stops it in motion.

Without the first, one message of 16 MB leaves 33 MB in a node for good: in the allocator of the process, and in the
readers of Fast DDS (transport.py). Without the second, a collection visits every object of the compiler, which takes up
to 220 ms in a process that has compiled its functions and 75 ms where it has loaded them; the hand is vented after
100 ms. Without the third, the system may take back code and data that were not used for a while; to read them again can
take as long.
"""

from __future__ import annotations

import ctypes
import gc
import inspect

MMAP_THRESHOLD = -3
"""Parameter of mallopt (malloc.h)."""
LARGE_BYTES = 131_072
"""Larger blocks go back to the system when they are freed; by default the threshold grows with each such block."""
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4
"""Flags of mlockall (mman.h)."""


def return_large_blocks() -> bool:
    """Let the allocator give large blocks back to the system; False where the C library has no such setting."""
    try:
        return bool(ctypes.CDLL(None).mallopt(MMAP_THRESHOLD, LARGE_BYTES))
    except (AttributeError, OSError):
        return False


def lock_memory() -> bool:
    """Keep in memory what this process has used; False where it may not (`ulimit -l`).

    Pages are locked when they are first used: all that is merely reserved would take a gigabyte.
    """
    try:
        return bool(ctypes.CDLL(None, use_errno=True).mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0)
    except (AttributeError, OSError):
        return False


def spare_collections() -> None:
    """Collect what is garbage, and let later collections leave out all that is alive now. Call it while vented."""
    gc.unfreeze()  # what an earlier call has left out may be garbage by now
    gc.collect()
    gc.freeze()


def find_modules() -> None:
    """Let `inspect` learn now which module each file belongs to: rclpy asks it with each line of the log."""
    inspect.getmodule(find_modules.__code__)
