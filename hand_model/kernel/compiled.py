"""Local arrays in compiled loops, and loops specialised to a set of effects."""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType
from typing import Any

from llvmlite import binding, ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic

_ALIGNMENT = 64
_WIDE = '"prefer-vector-width"="512"'
"""Attribute of a function for LLVM, which uses half of the widest vectors of some processors by default."""
# LLVM would unroll a loop over 8 or 16 lanes before it looks for vectors, and then find none.
binding.set_option("hand_model", "--unroll-full-max-count=3")
# It would also repeat the body of a short loop over lanes twice before that, and then gather every other lane.
binding.set_option("hand_model", "--unroll-max-count=1")
# Equations are long chains of operations that depend on each other. Two vectors at a time, where a loop has two, let
# a processor work on one of them while the other one waits.
binding.set_option("hand_model", "--force-vector-interleave=2")


@intrinsic  # type: ignore[untyped-decorator]
def stack_doubles(typing_context: Any, count: Any) -> Any:
    """Pointer to `count` (a constant) uninitialised doubles on the stack, alive until the calling function returns.

    Numba's arrays come from the heap and may overlap as far as the compiler knows, so loops over them do not
    vectorise. A local array overlaps nothing. It is aligned to a cache line of 64 bytes.
    """
    if not isinstance(count, types.IntegerLiteral):
        return None

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        # Without inlining, the function is the same machine code, and its result the same bits, for every caller.
        builder.function.attributes.add("noinline")
        set.add(builder.function.attributes, _WIDE)  # llvmlite's own `add` knows no attributes with a value
        with builder.goto_entry_block():
            memory = builder.alloca(ir.ArrayType(ir.DoubleType(), count.literal_value))
            memory.align = _ALIGNMENT
        return builder.bitcast(memory, ir.DoubleType().as_pointer())

    return types.CPointer(types.float64)(count), generate


def specialise(template: Callable[..., Any], names: dict[str, Any]) -> Callable[..., Any]:
    """A copy of a function whose global names are replaced.

    template: an uncompiled function whose closure holds a text that is unique for `names`; numba's cache
    separates specialised copies by the closure.  names: global name -> object, for instance a compiled equation.
    """
    assert isinstance(template, FunctionType)
    return FunctionType(
        template.__code__, {**template.__globals__, **names}, template.__name__, None, template.__closure__
    )
