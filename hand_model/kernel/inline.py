"""How the equations of the kernel are compiled: inlined into the loops, with arithmetic that keeps every rounding.

The compiler may ignore NaN and the sign of zero, which lets it turn min, max and select into vector instructions. It
may not contract, reassociate or use approximate reciprocals: the result of an equation must not depend on which other
equations are compiled into the same loop.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core.registry import CPUDispatcher

FAST = {"nnan", "nsz"}
"""Flags of LLVM's floating-point arithmetic that equations and loops use."""
_NO_WRAPPERS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


class _Equation(CPUDispatcher):  # type: ignore[misc]
    """An equation compiled for loops alone.

    Wrappers for callers in Python are left out, because they take two fifths of the compile time. The first call from
    Python compiles a second copy, which has them.
    """

    def __call__(self, *arguments: Any) -> Any:
        if not hasattr(self, "_for_python"):
            options = {name: value for name, value in self.targetoptions.items() if name not in _NO_WRAPPERS}
            self._for_python = CPUDispatcher(self.py_func, targetoptions=options)
        return self._for_python(*arguments)


def _inline(fastmath: Any) -> Callable[..., Any]:
    """Decorator that compiles an equation into the loop that calls it, with flags of floating-point arithmetic."""

    def decorate(function: Callable[..., Any]) -> Any:
        compiled = njit(forceinline=True, fastmath=fastmath, error_model="numpy", **_NO_WRAPPERS)(function)
        if not isinstance(compiled, CPUDispatcher):  # plain Python where numba is switched off
            return compiled
        return _Equation(function, targetoptions=compiled.targetoptions)

    return decorate


inline = _inline(FAST)
"""Compile an equation into the loop that calls it."""
inline_exact = _inline(False)
"""The same for equations whose NaN and sign of zero count."""


def inlined(function: Any) -> Any:
    """The equation, whether compiled already or plain Python, compiled again with the flags of the kernel."""
    plain: Callable[..., Any] = getattr(function, "py_func", function)
    return inline(plain)
