"""How the equations of the kernel are compiled: inlined into the loops, with arithmetic that keeps every rounding.

The compiler may ignore NaN and the sign of zero, which lets it turn min, max and select into vector instructions. It
may not contract, reassociate or use approximate reciprocals: the result of an equation must not depend on which other
equations are compiled into the same loop. Products are fused with sums as the source of an equation says (fused.py).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

from numba.core.registry import CPUDispatcher

from hand_model.compile_cache import njit
from hand_model.kernel.fused import fused

FAST = {"nnan", "nsz"}
"""Flags of LLVM's floating-point arithmetic that equations and loops use."""


class Equation:
    """An equation for loops, compiled when the first loop with it is compiled, and not at a start with a cache."""

    def __init__(self, function: Callable[..., Any], fastmath: Any) -> None:
        """fastmath: flags of floating-point arithmetic; none of them for every rounding and NaN of the source."""
        self.py_func = function
        self.__doc__, self.__name__ = function.__doc__, function.__name__
        self._fastmath = fastmath

    @cached_property
    def _fused(self) -> Callable[..., Any]:
        return fused(self.py_func) if self._fastmath else self.py_func

    def _compiled(self, **options: Any) -> Any:
        return njit(forceinline=True, fastmath=self._fastmath, error_model="numpy", **options)(self._fused)

    @cached_property
    def _for_loops(self) -> Any:
        """Without wrappers for callers in Python, which take two fifths of the compile time."""
        return self._compiled(no_cpython_wrapper=True, no_cfunc_wrapper=True)

    @cached_property
    def _for_python(self) -> Any:
        """Kept on disk where the equation stands in a file; a composed hook stands in none."""
        return self._compiled(cache=Path(self._fused.__code__.co_filename).is_file())

    @property
    def _numba_type_(self) -> Any:
        """What numba takes a global name with this value for."""
        return self._for_loops._numba_type_

    def __call__(self, *arguments: Any) -> Any:
        """Compute one result; the first call compiles a second copy, which has wrappers for Python."""
        return self._for_python(*arguments)


def _inline(fastmath: Any) -> Callable[..., Any]:
    """Decorator that compiles an equation into the loop that calls it, with flags of floating-point arithmetic.

    Where numba is switched off, the equation remains plain Python.
    """

    def decorate(function: Callable[..., Any]) -> Any:
        compiled = njit(function)  # without a call, this compiles nothing
        return Equation(function, fastmath) if isinstance(compiled, CPUDispatcher) else compiled

    return decorate


inline = _inline(FAST)
"""Compile an equation into the loop that calls it."""
inline_exact = _inline(False)
"""The same for equations whose NaN and sign of zero count."""


def inlined(function: Any) -> Any:
    """The equation, whether compiled already or plain Python, compiled again with the flags of the kernel."""
    plain: Callable[..., Any] = getattr(function, "py_func", function)
    return inline(plain)
