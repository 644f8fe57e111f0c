"""How the equations of the kernel are compiled: inlined into the loops, with arithmetic that keeps every rounding.

The compiler may ignore NaN and the sign of zero, which lets it turn min, max and select into vector instructions. It
may not contract, reassociate or use approximate reciprocals: the result of an equation must not depend on which other
equations are compiled into the same loop.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

FAST = {"nnan", "nsz"}
"""Flags of LLVM's floating-point arithmetic that equations and loops use."""

inline = njit(forceinline=True, fastmath=FAST, error_model="numpy")
"""Compile an equation into the loop that calls it."""


def inlined(function: Any) -> Any:
    """The equation, whether compiled already or plain Python, compiled again with the flags of the kernel."""
    plain: Callable[..., Any] = getattr(function, "py_func", function)
    return inline(plain)
