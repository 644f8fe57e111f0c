"""Compile the loops that most programs start with, so that no node compiles at its first start.

    python -m hand_model.kernel

Numba keeps them on disk next to the source, or in the user's cache where that folder is read-only. A change of any
equation makes them void, and the next start compiles anew.
"""

from __future__ import annotations

from hand_model.kernel.closed_loop import loops
from hand_model.kernel.open_loop import OPEN_EFFECTS, compile_loop

if __name__ == "__main__":
    loops(())
    compile_loop(OPEN_EFFECTS)
