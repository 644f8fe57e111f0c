"""Compile the loops that most programs start with, so that no node compiles at its first start.

Numba keeps them on disk next to the source, or in the user's cache where that folder is read-only. A change of any
equation makes them void, and the next start compiles them again.
"""

from __future__ import annotations

import argparse

from hand_model.kernel.closed_loop import loops
from hand_model.kernel.hooks import HAND_EFFECTS
from hand_model.kernel.open_stages import compile_loop


def main() -> None:
    """Compile the closed loops of the plain plant and of the studio, and the open loops of the fits."""
    argparse.ArgumentParser(
        prog="python -m hand_model.kernel",
        description="Compile the common loops of the kernel into the cache. Example: python -m hand_model.kernel",
    ).parse_args()
    loops(())
    loops(HAND_EFFECTS)
    compile_loop(())
    compile_loop(HAND_EFFECTS)
    compile_loop(HAND_EFFECTS, laws=True)


if __name__ == "__main__":
    main()
