"""Fused operations of equations: each form, their single rounding, closures, and what stays as it is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numba import njit

from hand_model.kernel.fused import fused
from hand_model.kernel.inline import inline

# (1 + e)^2 = 1 + 2 e + e^2, whose last part is lost where the product is rounded before the sum.
E = 2.0**-30
X, SQUARE = 1.0 + E, 1.0 + 2.0 * E


def product_first(a, b, c):  # type: ignore[no-untyped-def]
    return a * b + c


def product_last(a, b, c):  # type: ignore[no-untyped-def]
    return c + a * b


def product_less(a, b, c):  # type: ignore[no-untyped-def]
    return a * b - -c


def less_product(a, b, c):  # type: ignore[no-untyped-def]
    return c - -a * b


def added_in_place(a, b, c):  # type: ignore[no-untyped-def]
    c += a * b
    return c


def taken_in_place(a, b, c):  # type: ignore[no-untyped-def]
    c -= -a * b
    return c


@pytest.mark.parametrize(
    "form", [product_first, product_last, product_less, less_product, added_in_place, taken_in_place]
)
def test_every_form_rounds_once(form: Callable[..., Any]) -> None:
    """Fails when a form is not fused, or with a wrong sign: two roundings leave 0 of E^2."""
    assert form(X, X, -SQUARE) == 0.0
    assert njit(fused(form))(X, X, -SQUARE) == E * E


def test_whole_numbers_stay_whole() -> None:
    """Fails when an index is computed as a real number."""
    assert njit(fused(product_first))(3, 5, 2) == 17
    assert isinstance(njit(fused(product_first))(3, 5, 2), int)


def test_equations_compute_the_same_for_python_and_for_loops() -> None:
    """Fails when an equation that Python calls is not the fused one of the loops, or loses its closure."""
    offset = -SQUARE

    @inline
    def equation(x):  # type: ignore[no-untyped-def]
        return x * x + offset

    def loop(x):  # type: ignore[no-untyped-def]
        return equation(x)

    values = [X, 1.0, 0.3]
    np.testing.assert_array_equal([equation(x) for x in values], [njit(loop)(x) for x in values])
    assert equation(X) == E * E
    assert equation.py_func(X) == 0.0


def test_a_function_without_source_stays_as_it_is() -> None:
    """Fails when a composed function, which has no source, cannot be compiled any more."""
    space: dict[str, Any] = {}
    exec("def composed(x): return x + x * x", space)
    assert fused(space["composed"]) is space["composed"]
