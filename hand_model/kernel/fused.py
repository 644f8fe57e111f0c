"""Equations with fused multiply-add: a * b + c with one rounding, which processors compute as fast as the product.

The operations are fused as they are written in the source of an equation, and not where a compiler finds it convenient:
the result does not depend on which other equations are compiled into the same loop.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable
from textwrap import dedent
from types import CodeType, FunctionType
from typing import Any

from numba import types
from numba.extending import intrinsic

_NAME = "fused_multiply_add"


@intrinsic  # type: ignore[untyped-decorator]
def fused_multiply_add(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    """a * b + c: rounded once for real numbers, exact for whole numbers."""
    whole = all(isinstance(argument, types.Integer) for argument in (a, b, c))
    number = types.int64 if whole else types.float64

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        if whole:
            return builder.add(builder.mul(arguments[0], arguments[1]), arguments[2])
        return builder.fma(*arguments)

    return number(number, number, number), generate


class _Fuse(ast.NodeTransformer):
    """a * b + c, c + a * b, a * b - c and c - a * b as calls; where both sides are products, the left one is fused."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        if not isinstance(node.op, ast.Add | ast.Sub):
            return node
        minus = isinstance(node.op, ast.Sub)
        for product, other, left in ((node.left, node.right, True), (node.right, node.left, False)):
            if isinstance(product, ast.BinOp) and isinstance(product.op, ast.Mult):
                a = _negative(product.left) if minus and not left else product.left
                c = _negative(other) if minus and left else other
                return ast.Call(ast.Name(_NAME, ast.Load()), [a, product.right, c], [])
        return node

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        """x += a * b as x = x + a * b, where x is a name."""
        if not isinstance(node.target, ast.Name):
            return self.generic_visit(node)
        value = ast.BinOp(ast.Name(node.target.id, ast.Load()), node.op, node.value)
        return ast.Assign([node.target], self.visit_BinOp(value))


def _negative(node: ast.expr) -> ast.expr:
    return ast.UnaryOp(ast.USub(), node)


def fused(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same function with fused operations; unchanged where it has no source of its own.

    Its closure is shared. Its global names are those of now.
    """
    assert isinstance(function, FunctionType)
    try:
        source = dedent(inspect.getsource(function))
    except OSError:  # composed of other functions, see hooks.py
        return function
    tree = ast.parse(source)
    definition = tree.body[0]
    assert isinstance(definition, ast.FunctionDef)
    definition.decorator_list = []
    outside = function.__code__.co_freevars
    factory = ast.parse(f"def factory({', '.join(outside)}):\n    pass")
    outer = factory.body[0]
    assert isinstance(outer, ast.FunctionDef)
    outer.body = [_Fuse().visit(definition)]
    ast.increment_lineno(factory, function.__code__.co_firstlineno - 1)
    whole = compile(ast.fix_missing_locations(factory), function.__code__.co_filename, "exec")
    code = _inner(_inner(whole, "factory"), function.__name__)
    cells = dict(zip(outside, function.__closure__ or (), strict=True))
    names = {**function.__globals__, _NAME: fused_multiply_add}
    closure = tuple(cells[name] for name in code.co_freevars)
    return FunctionType(code, names, function.__name__, function.__defaults__, closure)


def _inner(code: CodeType, name: str) -> CodeType:
    """Code of a function that is defined within a code."""
    return next(each for each in code.co_consts if isinstance(each, CodeType) and each.co_name == name)
