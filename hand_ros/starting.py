"""A program that is read into memory first, and starts when a line says so: reading takes a second."""

from __future__ import annotations

import os
import sys

WHEN_TOLD = "FLUIDIC_HAND_START_WHEN_TOLD"
"""Environment variable by which whoever starts a program wants that; a line on the standard input starts it."""


def told_to_start() -> bool:
    """Wait for the line where it is wanted; False where the input or the user ends the program instead."""
    try:
        return WHEN_TOLD not in os.environ or bool(sys.stdin.readline())
    except KeyboardInterrupt:
        return False
