"""Rows of lanes on the stack of a compiled function: what a local array is in C.

NumPy arrays inside numba come from the heap, aligned to 32 bytes and, for all the compiler knows, overlapping
each other; then nothing vectorises well. A local array overlaps nothing, and aligned to a cache line it keeps
the whole stack frame aligned, so that vector registers spill without crossing lines.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic

_ALIGNMENT = 64


@intrinsic  # type: ignore[untyped-decorator]
def stack_doubles(typing_context: Any, count: Any) -> Any:
    """Pointer to `count` (a constant) uninitialised doubles, alive until the calling function returns."""
    if not isinstance(count, types.IntegerLiteral):
        return None

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        # Not inlined, the function is the same machine code, and its result the same bits, whoever calls it.
        builder.function.attributes.add("noinline")
        with builder.goto_entry_block():
            memory = builder.alloca(ir.ArrayType(ir.DoubleType(), count.literal_value))
            memory.align = _ALIGNMENT
        return builder.bitcast(memory, ir.DoubleType().as_pointer())

    return types.CPointer(types.float64)(count), generate
